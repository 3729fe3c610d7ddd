#include "app/sweep/results.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/sweep/report/report_content.h"
#include "base/file.h"
#include "tests/app/sweep/fake_sweep.h"

namespace slalom::sweep {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(SweepResultsTest, RowsHoldTheSeedsThatAreThere) {
  const test::FakeSweep fake = test::MakeTrainingSets();
  const SweepResults results = fake.Results();
  ASSERT_EQ(results.rows.size(), 3u);
  EXPECT_EQ(results.rows[1].name, "10");
  EXPECT_THAT(results.rows[1].cells, ElementsAre(3, 4, 5));
  ASSERT_EQ(results.scores.size(), 2u);
  const std::vector<RowScore>& rows = results.scores[0].rows;
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_TRUE(rows[0].is_complete());
  EXPECT_EQ(rows[1].seeds.size(), 1u);
  EXPECT_EQ(rows[1].seeds[0].cell, 3u);
  EXPECT_EQ(rows[1].num_planned, 3);
  EXPECT_EQ(rows[2].seeds.size(), 0u);
  EXPECT_EQ(rows[2].num_planned, 3);
  EXPECT_EQ(results.num_cells(CellState::kDone), 4);
  EXPECT_EQ(results.num_cells(CellState::kFailed), 1);
  EXPECT_EQ(results.num_cells(CellState::kWaiting), 4);
}

TEST(SweepResultsTest, TitlesOfRowsNameTheAxes) {
  const std::vector<std::string> keys{"learner.n_step", "network.head_layers"};
  EXPECT_EQ(RowTitle(keys, {"4.0", "[64, 64]"}), "n_step 4.0 / head_layers [64, 64]");
  EXPECT_EQ(RowTitle(keys, {"4.0"}), "n_step 4.0");
  EXPECT_EQ(RowTitle({"method", "H"}, {"TD3", "4"}), "TD3 / H 4");
  EXPECT_EQ(RowTitle({"courses.fresh", "mirrored"}, {"static", "true"}),
            "fresh static / mirrored true");
  EXPECT_EQ(RowTitle({"actor.rate", "critic.rate"}, {"1e-3", "1e-4"}),
            "actor.rate 1e-3 / critic.rate 1e-4");
}

TEST(SweepResultsTest, EverythingThatIsMissingIsListed) {
  const SweepResults results = test::MakeTrainingSets().Results();
  ASSERT_EQ(results.missing.size(), 10u);  // Two scores of five cells.
  EXPECT_EQ(results.missing[0].cell, 4u);
  EXPECT_EQ(results.missing[0].score, "test");
  EXPECT_EQ(results.missing[0].why, "failed");
  EXPECT_EQ(results.missing[2].cell, 5u);
  EXPECT_EQ(results.missing[2].why, "waiting");
}

TEST(SweepResultsTest, ADamagedEvaluationIsMissingAndSaysWhy) {
  const test::FakeSweep fake = test::MakeTrainingSets();
  const CellDirectory directory(fake.store(), fake.cell(1).id);
  const auto file = directory.score(fake.cell(1).scores[0]) / "evaluation.json";
  const std::string text = base::ReadFile(file);
  base::WriteFileAtomically(file, text.substr(0, text.size() / 2));
  const SweepResults results = fake.Results();
  EXPECT_EQ(results.scores[0].rows[0].seeds.size(), 2u);
  ASSERT_EQ(results.missing.size(), 11u);
  EXPECT_EQ(results.missing[0].cell, 1u);
  EXPECT_THAT(results.missing[0].why, HasSubstr("evaluation.json: not valid JSON"));
}

TEST(SweepResultsTest, AnEvaluationOnOtherCoursesIsLeftOutAndSaysSo) {
  test::FakeSweep fake = test::MakeTrainingSets();
  fake.Evaluate(1, "test", {"SSSSS"});
  const SweepResults results = fake.Results();
  EXPECT_EQ(results.scores[0].rows[0].seeds.size(), 2u);
  EXPECT_THAT(results.missing[0].why, HasSubstr("has 1 courses"));
}

TEST(SweepResultsTest, ARowIsAnAgentWithItsSeeds) {
  const SweepResults results = test::MakeTrainingSets().Results();
  const RowScore& row = results.scores[0].rows[0];
  const eval::Agent agent = AgentOf(results, row);
  EXPECT_EQ(agent.label, "training courses 5");
  EXPECT_TRUE(agent.is_trained);
  EXPECT_THAT(agent.seeds,
              ElementsAre(&row.seeds[0].result, &row.seeds[1].result, &row.seeds[2].result));
  EXPECT_EQ(AgentOf(results, results.scores[0].rows[1]).num_planned, 3);
}

TEST(SweepContentTest, AScoreHasTheFiguresOfItsRowsAndTheirTrainings) {
  const test::FakeSweep fake = test::MakeTrainingSets();
  const ReportContent content = fake.Content();
  const ScoreContent& score = content.scores.at(0);
  ASSERT_EQ(score.group.agents.size(), 3u);
  EXPECT_NEAR(score.group.agents[0].success().estimate->value, 0.6, 1e-12);
  EXPECT_FALSE(score.group.agents[2].success().estimate);
  EXPECT_NEAR(*score.group.agents[0].training->training_s, 50.0, 1e-9);  // 40, 50 and 60.
  EXPECT_EQ(score.group.agents[2].training->steps, std::nullopt);
  ASSERT_EQ(score.group.pairs.size(), 1u);  // The third row has nothing.
  EXPECT_NEAR(score.group.pairs[0].difference().value, 0.6 - 0.9, 1e-12);
  const auto& published = score.group.agents[0].published;
  ASSERT_EQ(published.size(), 1u);
  EXPECT_EQ(published[0].quantity, 0u);
  EXPECT_EQ(published[0].value, 0.43);
  EXPECT_EQ(published[0].deviation, 0.02);
}

/// Two seeds with snapshots after 1000 and 2000 of 4000 steps. The run logs 1000 steps at 10 s
/// (between two rows), 2000 at 30 s, and ends at 40 s. Successes of seed 1: 1, 3 and 4 of 5.
test::FakeSweep MakeSnapshots() {
  test::FakeSweep fake({"method"}, {"test"});
  for (const int seed : {1, 2}) {
    const std::size_t cell = fake.AddTraining({"TD3"}, seed);
    fake.AddSnapshot(cell, 1000);
    fake.AddSnapshot(cell, 2000);
    fake.FinishTraining(cell);
    base::MakeDirectories(CellDirectory(fake.store(), fake.cell(cell).id).run());
    base::WriteFileAtomically(
        CellDirectory(fake.store(), fake.cell(cell).id).run() / "metrics.csv",
        "training_s,steps,updates\n5,500,1\n15,1500,2\n30,2000,3\n39,3900,4\n");
  }
  fake.Evaluate(0, "test", {"SCCCC", "SCCCC"}, 10.0, 1000);
  fake.Evaluate(0, "test", {"SSSCC", "SSSCC"}, 10.0, 2000);
  fake.Evaluate(0, "test", {"SSSSC", "SSSSC"});
  fake.Evaluate(1, "test", {"SSCCC", "SSCCC"}, 10.0, 1000);
  fake.Evaluate(1, "test", {"SSSSS", "SSSSS"});
  return fake;
}

TEST(LearningCurvesTest, ACurveHasTheAreaComputedByHand) {
  const test::FakeSweep fake = MakeSnapshots();
  const SweepResults results = fake.Results();
  const auto curves = LearningCurves(results, results.scores[0]);
  ASSERT_EQ(curves.size(), 1u);
  // The second seed's second snapshot is missing, so it is not in the curve.
  EXPECT_EQ(curves[0].num_seeds, 1);
  EXPECT_EQ(curves[0].num_planned, 2);
  ASSERT_EQ(curves[0].points.size(), 3u);
  EXPECT_EQ(curves[0].points[2].steps, 4000);
  EXPECT_NEAR(curves[0].points[0].success.value, 0.2, 1e-12);
  EXPECT_NEAR(*curves[0].points[0].seconds, 10.0, 1e-9);
  EXPECT_NEAR(*curves[0].points[1].seconds, 30.0, 1e-9);
  EXPECT_NEAR(*curves[0].points[2].seconds, 40.0, 1e-9);
  EXPECT_NEAR(curves[0].area_over_steps.value, (0.4 * 1000 + 0.7 * 2000) / 3000, 1e-12);
  EXPECT_NEAR(curves[0].area_over_seconds->value, (0.4 * 20 + 0.7 * 10) / 30, 1e-12);
}

}  // namespace
}  // namespace slalom::sweep
