#include "app/sweep/report/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "tests/app/sweep/fake_sweep.h"

namespace slalom::sweep {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::vector<std::string> Fields(const std::string& line) {
  std::vector<std::string> fields(1);
  for (const char c : line) {
    if (c == ',') {
      fields.emplace_back();
    } else {
      fields.back() += c;
    }
  }
  return fields;
}

/// The cell of a CSV without quoted fields.
std::string CsvCell(const std::string& csv, std::size_t line, const std::string& column) {
  const std::vector<std::string> lines = Lines(csv);
  const std::vector<std::string> head = Fields(lines.at(0));
  const std::vector<std::string> fields = Fields(lines.at(line));
  EXPECT_EQ(fields.size(), head.size()) << lines.at(line);
  const auto at = std::ranges::find(head, column) - head.begin();
  return fields.at(at);
}

TEST(SweepReportTest, MarkdownHasEveryRowAndWhatIsMissing) {
  const std::string text = test::MakeTrainingSets().Report("report.md");
  EXPECT_THAT(text, HasSubstr("# A \\<fake\\> sweep (built-in courses, cone friction)\n"));
  EXPECT_THAT(text, HasSubstr("- Cells: 4 of 9 done, 4 waiting, 1 failed\n"));
  EXPECT_THAT(text, HasSubstr("- Budget of a training: 4k steps\n"));
  EXPECT_THAT(text, HasSubstr("- Machine: node-1 (up to 2 cells at a time)\n"));
  EXPECT_THAT(text, HasSubstr("- Commit: abc123\n"));
  EXPECT_THAT(text, HasSubstr("\n| training courses 5 | 3 | 60 | 60.0 ("));
  EXPECT_THAT(text, HasSubstr("\n| training courses 10 | **1 of 3** | 20 | 90.0 ("));
  EXPECT_THAT(text, HasSubstr("\n| training courses 50 | **0 of 3** | 0 | – |"));
  EXPECT_THAT(text, HasSubstr("| steps | training |\n"));
  EXPECT_THAT(text, HasSubstr("| 4k | 0:50 |\n"));
  EXPECT_THAT(text, HasSubstr("1 cell failed; the end of its log stands under Failures."));
  EXPECT_THAT(text, HasSubstr("slalom train ended with 1 \\<three times\\>"));
  EXPECT_THAT(text, HasSubstr("no space left\non the device"));
  EXPECT_THAT(text, HasSubstr("- 10, seed 2, test: failed\n"));
  EXPECT_THAT(text, HasSubstr("- 50, seed 3, training: waiting\n"));
}

TEST(SweepReportTest, ImaginedTransitionsStandBesideTheSteps) {
  test::FakeSweep sweep({"method"}, {"test"});
  for (const std::string method : {"TD3", "Dyna"}) {
    const std::size_t cell = sweep.AddTraining({method}, 1);
    if (method == "TD3") sweep.FinishTraining(cell);
    if (method == "Dyna") sweep.FinishTraining(cell, 40.0, 5'120'000);
    sweep.Evaluate(cell, "test", {"SSC"});
  }
  const std::string text = sweep.Report("report.md");
  EXPECT_THAT(text, HasSubstr("| 4k | 0:40 |\n| Dyna |"));
  EXPECT_THAT(text, HasSubstr("| 4k + 5.12M imagined | 0:40 |\n"));
  const std::string rows = sweep.Report("report-rows.csv");
  EXPECT_EQ(CsvCell(rows, 1, "imagined"), "");
  EXPECT_EQ(CsvCell(rows, 2, "imagined"), "5.12e+06");
  EXPECT_EQ(CsvCell(sweep.Report("report.csv"), 2, "imagined"), "5120000");
}

TEST(SweepReportTest, TheCsvOfCellsHasALineForEachEvaluationOfThePlan) {
  const std::string csv = test::MakeTrainingSets().Report("report.csv");
  EXPECT_EQ(Lines(csv).size(), 1u + 9 * 2);
  EXPECT_EQ(CsvCell(csv, 3, "id"), "all-5-2");
  EXPECT_EQ(CsvCell(csv, 3, "training courses"), "5");
  EXPECT_EQ(CsvCell(csv, 3, "seed"), "2");
  EXPECT_EQ(CsvCell(csv, 3, "score"), "test");
  EXPECT_EQ(CsvCell(csv, 3, "state"), "done");
  EXPECT_EQ(CsvCell(csv, 3, "success_rate"), "0.6");
  EXPECT_EQ(CsvCell(csv, 3, "collision_rate"), "0.3");  // 3 + 3 of 20
  EXPECT_EQ(CsvCell(csv, 3, "timeout_rate"), "0.1");
  EXPECT_EQ(CsvCell(csv, 3, "traversal_time_s"), "12");
  EXPECT_EQ(CsvCell(csv, 3, "survival_time_s"), "23.75");  // 6 of 5 s and 2 of 80 s.
  EXPECT_EQ(CsvCell(csv, 3, "training_s"), "50");
  EXPECT_EQ(CsvCell(csv, 3, "host"), "node-1");
  EXPECT_EQ(CsvCell(csv, 9, "state"), "failed");
  EXPECT_EQ(CsvCell(csv, 9, "success_rate"), "");
  EXPECT_EQ(CsvCell(csv, 18, "state"), "waiting");
}

TEST(SweepReportTest, TheCsvOfRowsHasMeansAndIntervals) {
  const std::string csv = test::MakeTrainingSets().Report("report-rows.csv");
  EXPECT_EQ(Lines(csv).size(), 1u + 3 * 2);
  EXPECT_EQ(CsvCell(csv, 1, "row"), "5");
  EXPECT_EQ(CsvCell(csv, 1, "training courses"), "5");
  EXPECT_EQ(CsvCell(csv, 1, "success_rate"), "0.600000");
  EXPECT_LT(std::stod(CsvCell(csv, 1, "success_rate_low")), 0.5);
  EXPECT_EQ(CsvCell(csv, 1, "success_rate_deviation"), "0.100000");
  EXPECT_EQ(CsvCell(csv, 1, "steps"), "4000");
  EXPECT_EQ(CsvCell(csv, 1, "training_s"), "50");
  EXPECT_EQ(CsvCell(csv, 2, "seeds"), "1");
  EXPECT_EQ(CsvCell(csv, 2, "planned_seeds"), "3");
  EXPECT_EQ(CsvCell(csv, 3, "success_rate"), "");
  EXPECT_EQ(CsvCell(csv, 4, "score"), "training");
}

TEST(SweepReportTest, OneAxisSetsRowsSideBySide) {
  EXPECT_THAT(test::MakeTrainingSets().Report("report.md"),
              HasSubstr("| training courses | 5 | 10 | 50 |\n|---|---:|---:|---:|\n"
                        "| Success rate (%) (↑) | 60.0 ± 10.0 | **90.0** (1/3 seeds) | – |\n"
                        "| *the paper* | 43.0 ± 2.0 | 50.0 ± 3.0 | 65.0 ± 4.0 |\n"));
}

TEST(SweepReportTest, MarkdownBeginsWithTheTablesOfThePaper) {
  const std::string text = test::MakeArchitectures().Report("report.md");
  EXPECT_THAT(
      text, HasSubstr("| Success rate (%) (↑) | on static, H 1 | on static, H 4 | on walls, H 1 | "
                      "on walls, H 4 |\n|---|---:|---:|---:|---:|\n"
                      "| MLP | 50.0 ± 0.0 | 50.0 ± 0.0 | 66.7 ± 23.6 | 66.7 ± 23.6 |\n"
                      "| *the paper* | 65.0 ± 4.0 | 57.0 ± 7.0 | – | – |\n"
                      "| GRU | – | **83.3 ± 0.0** | – | 66.7 ± 23.6 |\n"
                      "| DWA | 50.0 |  | **83.3** |  |\n"));
}

TEST(SweepReportTest, TheAxisOfColumnsPutsTrainingsOfOneRowBelowTheirScores) {
  test::FakeSweep fake({"method"}, {"static", "walls"});
  for (const char* column : {"static", "walls"}) {
    const std::size_t cell = fake.AddTraining({"TD3"}, 1, column);
    fake.FinishTraining(cell);
    fake.Evaluate(cell, column, {column == std::string("static") ? "SSSC" : "SCCC"});
  }
  const std::string text = fake.Report("report.md");
  EXPECT_THAT(text, HasSubstr("- Cells: 2 of 2 done"));
  EXPECT_THAT(text, HasSubstr("| TD3 | 1 | 4 | 75.0"));
  EXPECT_THAT(text, HasSubstr("| TD3 | 1 | 4 | 25.0"));
}

TEST(SweepReportTest, QuantitiesOfThePlanHaveATableWithTheScoresSideBySide) {
  test::FakeSweep fake({"method"}, {"test", "walls"});
  for (const char* method : {"TD3", "SAC"}) {
    const std::size_t cell = fake.AddTraining({method}, 1);
    fake.Evaluate(cell, "test", {"SSSC"});
    if (method == std::string("SAC")) fake.Evaluate(cell, "walls", {"SC"});
  }
  fake.plan.sweep.quantities = {"success_rate"};
  const std::string text = fake.Report("report.md");
  EXPECT_THAT(text, HasSubstr("| Success rate (%) (↑) | on test | on walls |\n|---|---:|---:|\n"
                              "| TD3 | 75.0 | – |\n| SAC | 75.0 | 50.0 |\n"));
  EXPECT_THAT(text, Not(HasSubstr("Traversal time")));
}

TEST(SweepReportTest, TheTitleSaysWhoseCoursesTheyAreAndWithWhatFriction) {
  test::FakeSweep fake({"method"}, {"test"});
  fake.AddTraining({"TD3"}, 1);
  fake.cells.cells[0].friction = "gazebo";
  EXPECT_THAT(fake.Report("report.md"), HasSubstr("sweep (built-in courses, gazebo friction)\n"));
  fake.cells.cells[0].collection = "barn";
  EXPECT_THAT(fake.Report("report.md"), HasSubstr("sweep (collection barn, gazebo friction)"));
}

TEST(SweepReportTest, APlannerHasNoSeeds) {
  const std::string text = test::MakeArchitectures().Report("report.md");
  EXPECT_THAT(text, HasSubstr("| DWA | – | 6 | 50.0 ("));
  EXPECT_THAT(text, HasSubstr("| GRU / H 4 | 2 | 12 | 83.3 ("));
}

TEST(SweepReportTest, TheSummaryNamesSeedsThatAreMissing) {
  const test::FakeSweep fake = test::MakeTrainingSets();
  const std::string text = SweepSummary(fake.Content());
  const std::vector<std::string> lines = Lines(text);
  ASSERT_EQ(lines.size(), 5u);
  EXPECT_THAT(lines[0], HasSubstr("| on test"));
  EXPECT_THAT(lines[2], HasSubstr("| training courses 5  | 60.0 ("));
  EXPECT_THAT(lines[3], HasSubstr("1 of 3 seeds"));
  EXPECT_THAT(lines[4], HasSubstr("| –"));
}

TEST(SweepReportTest, TheSummaryIsTallerThanWide) {
  test::FakeSweep fake({"method"}, {"first", "second", "third"});
  const std::size_t cell = fake.AddTraining({"TD3"}, 1);
  fake.Evaluate(cell, "second", {"SC"});
  const std::vector<std::string> lines = Lines(SweepSummary(fake.Content()));
  ASSERT_EQ(lines.size(), 5u);
  EXPECT_THAT(lines[0], AllOf(HasSubstr("| success [%]"), HasSubstr("| TD3 ")));
  EXPECT_THAT(lines[2], HasSubstr("| on first"));
  EXPECT_THAT(lines[3], HasSubstr("| 50.0"));
}

TEST(SweepReportTest, RowsThatWereTrainedOnTheirTestAreNamed) {
  test::FakeSweep fake({"method"}, {"test", "training"});
  fake.plan.scores[1].courses = "training";
  const std::size_t td3 = fake.AddTraining({"TD3"}, 1);
  const std::size_t sac = fake.AddTraining({"SAC"}, 1);
  fake.Evaluate(td3, "test", {"SSC", "SCC"});
  fake.SetTrainingOverlap(1);
  fake.Evaluate(sac, "test", {"SSC", "SCC"});
  fake.Evaluate(sac, "training", {"SSC", "SCC"});
  const std::string text = fake.Report("report.md");
  const std::string note = "Trained on some of these courses: SAC (1 of 2).";
  EXPECT_THAT(text, HasSubstr(note));
  EXPECT_EQ(text.find(note), text.rfind(note));
}

TEST(SweepReportTest, SnapshotsHaveATableByTheirSteps) {
  test::FakeSweep fake({"method"}, {"test"});
  const std::size_t cell = fake.AddTraining({"TD3"}, 1);
  fake.AddSnapshot(cell, 1000);
  fake.FinishTraining(cell);
  fake.Evaluate(cell, "test", {"SCC", "CCC"}, 10.0, 1000);
  fake.Evaluate(cell, "test", {"SSS", "SSC"});
  const std::string text = fake.Report("report.md");
  EXPECT_THAT(text, HasSubstr("| Steps | 1k | end |\n|---|---:|---:|\n| TD3 | 16.7 | 83.3 |\n"));
  EXPECT_THAT(text, HasSubstr("| TD3, after 1k steps | 1 | 6 | 16.7 ("));
  EXPECT_THAT(text, HasSubstr("| TD3, at the end | 1 | 6 | 83.3 ("));
  const std::string rows = fake.Report("report-rows.csv");
  EXPECT_EQ(CsvCell(rows, 2, "snapshot_steps"), "1000");
  EXPECT_EQ(CsvCell(rows, 2, "steps"), "1000");
  EXPECT_EQ(CsvCell(rows, 2, "success_rate"), "0.166667");
  EXPECT_EQ(CsvCell(rows, 1, "steps"), "4000");
}

/// Two rows of a grid; the first has 29 successes of 80 episodes, 36.25 %, on ten courses.
test::FakeSweep MakeGridSweep() {
  test::FakeSweep fake({"learner.n_step", "network.head_layers"}, {"test"});
  std::vector<std::string> outcomes(9, "SSSCCCCC");
  outcomes.push_back("SSCCCCCC");
  fake.Evaluate(fake.AddTraining({"4", "[64, 64]"}, 1), "test", outcomes);
  fake.Evaluate(fake.AddTraining({"8", "[64, 64]"}, 1), "test",
                std::vector<std::string>(10, "SCCCCCCC"));
  return fake;
}

TEST(SweepReportTest, RowsOfAGridNameTheirAxesAndTheBest) {
  test::FakeSweep fake = MakeGridSweep();
  const std::string text = fake.Report("report.md");
  EXPECT_THAT(text, HasSubstr("| n\\_step 4 / head\\_layers \\[64, 64\\] | n\\_step 8 / "));
  EXPECT_THAT(text, HasSubstr("\n\nBest row: n\\_step 4 / head\\_layers \\[64, 64\\], with 36.3 % "
                              "success, of 2 rows."));
  EXPECT_THAT(text, HasSubstr("| on test, head\\_layers \\[64, 64\\] |"));
  EXPECT_THAT(text, HasSubstr("| n\\_step 4 | **36.3** |"));
  EXPECT_THAT(fake.Report("report.html"), HasSubstr("Best row: n_step 4 / head_layers [64, 64]"));
  // A planner is no row of the grid, and no row is the best of one.
  fake.Evaluate(fake.AddPlanner({"DWA"}), "test", std::vector<std::string>(10, "SSSSSSSS"));
  EXPECT_THAT(fake.Report("report.md"), HasSubstr("Best row: n\\_step 4"));
  test::FakeSweep one({"learner.n_step"}, {"test"});
  one.Evaluate(one.AddTraining({"4"}, 1), "test", {"SC"});
  EXPECT_THAT(one.Report("report.md"), Not(HasSubstr("Best row")));
}

TEST(SweepReportTest, AHalfIsRoundedTheSameWayInEveryForm) {
  const test::FakeSweep fake = MakeGridSweep();
  ASSERT_EQ(100.0 * fake.Results().scores[0].rows[0].seeds[0].result.set.success_rate.value, 36.25);
  const std::string markdown = fake.Report("report.md");
  EXPECT_THAT(markdown, HasSubstr("| n\\_step 4 / head\\_layers \\[64, 64\\] | 1 | 80 | 36.3 ("));
  EXPECT_THAT(markdown, Not(HasSubstr("36.2")));
  EXPECT_THAT(SweepSummary(fake.Content()),
              HasSubstr("| n_step 4 / head_layers [64, 64] | 36.3 ("));
}

TEST(SweepReportTest, ASweepThatHasNotBegunHasAReport) {
  test::FakeSweep fake({"method"}, {"test"});
  fake.AddTraining({"TD3"}, 1);
  EXPECT_THAT(fake.Report("report.md"), HasSubstr("| TD3 | **0 of 1** | 0 | –"));
  EXPECT_THAT(fake.Report("report.html"), Not(HasSubstr("/*DATA*/")));
}

TEST(SweepReportTest, ABudgetOfSecondsIsSaidToDependOnTheMachine) {
  test::FakeSweep fake = test::MakeTrainingSets();
  fake.plan.budget = {};
  fake.plan.budget.seconds = 180.0;
  fake.plan.sweep.lockstep = false;
  const std::string text = fake.Report("report.md");
  EXPECT_THAT(text, HasSubstr("Each training lasted 3:00."));
  EXPECT_THAT(text, HasSubstr("with threads"));
  fake.plan.sweep.trainer = Trainer::kService;
  fake.plan.sweep.actors = 3;
  EXPECT_THAT(fake.Report("report.md"), HasSubstr("by a service of 3 actors"));
}

}  // namespace
}  // namespace slalom::sweep
