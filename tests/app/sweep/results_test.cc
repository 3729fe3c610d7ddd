#include "app/sweep/results.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/sweep/report/figures.h"
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

TEST(SweepResultsTest, TablesAreBySeedAndCourse) {
  const SweepResults results = test::MakeTrainingSets().Results();
  const RowScore& row = results.scores[0].rows[0];
  EXPECT_THAT(RateTable(row, kQuantities[0]).scores,
              ElementsAre(ElementsAre(0.8, 0.8, 0.2, 0.2), ElementsAre(1.0, 0.8, 0.4, 0.2),
                          ElementsAre(1.0, 1.0, 0.6, 0.2)));
  EXPECT_THAT(RateTable(row, kQuantities[1]).scores[0], ElementsAre(0.2, 0.0, 0.8, 0.6));
  // Survival: collisions after 5 s, timeouts after 80 s.
  const eval::RatioTables survival = TablesOf(row, kQuantities[2]);
  EXPECT_THAT(survival.counts.scores[0], ElementsAre(1, 1, 4, 4));
  EXPECT_THAT(survival.sums.scores[0], ElementsAre(5.0, 80.0, 20.0, 95.0));
  EXPECT_EQ(survival.sums.limits.high, 80.0);
  EXPECT_NEAR(*ValueOf(row.seeds[1].result, kQuantities[3]), 12.0, 1e-9);
}

TEST(SweepFiguresTest, FiguresOfARowAreThoseComputedByHand) {
  const test::FakeSweep fake = test::MakeTrainingSets();
  const SweepResults results = fake.Results();
  const RowFigures figures = FiguresOf(fake.plan, results, "test", results.scores[0].rows[0]);
  EXPECT_EQ(figures.num_seeds, 3);
  EXPECT_EQ(figures.num_episodes, 60);
  // Successes: 10, 12 and 14 of 20.
  EXPECT_NEAR(figures.success().estimate->value, 0.6, 1e-12);
  EXPECT_NEAR(*figures.success().seed_mean, 0.6, 1e-12);
  EXPECT_NEAR(*figures.success().seed_deviation, 0.1, 1e-12);
  // Sorted by seed and course: 0.2 0.2 0.2 | 0.2 0.4 0.6 0.8 0.8 0.8 | 1 1 1.
  EXPECT_NEAR(figures.interquartile_mean->value, 3.6 / 6, 1e-12);
  // Traversal: 10 x 10 s, 12 x 12 s, 14 x 14 s; seeds' means 10, 12 and 14 s.
  EXPECT_NEAR(figures.quantities[3].estimate->value, 440.0 / 36, 1e-9);
  EXPECT_NEAR(*figures.quantities[3].seed_mean, 12.0, 1e-9);
  EXPECT_NEAR(*figures.quantities[3].seed_deviation, 2.0, 1e-9);
  EXPECT_NEAR(*figures.training_s, 50.0, 1e-9);  // 40, 50 and 60.
  ASSERT_EQ(figures.published[0].size(), 1u);
  EXPECT_EQ(figures.published[0][0].value, 0.43);
  EXPECT_EQ(*figures.published[0][0].deviation, 0.02);
  EXPECT_TRUE(figures.published[1].empty());
}

TEST(SweepFiguresTest, ARowWithoutSeedsHasNoFigures) {
  const test::FakeSweep fake = test::MakeTrainingSets();
  const SweepResults results = fake.Results();
  const RowFigures figures = FiguresOf(fake.plan, results, "test", results.scores[0].rows[2]);
  EXPECT_FALSE(figures.success().estimate);
  EXPECT_FALSE(figures.success().seed_mean);
  EXPECT_FALSE(figures.interquartile_mean);
  EXPECT_EQ(figures.published[0][0].value, 0.65);
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

TEST(SweepFiguresTest, ACurveHasTheAreaComputedByHand) {
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

TEST(SweepFiguresTest, OnlyRowsOnTheSameCoursesAreCompared) {
  test::FakeSweep fake = test::MakeTrainingSets();
  const SweepResults results = fake.Results();
  const RowPairs pairs = CompareRows(results.scores[0]);
  ASSERT_EQ(pairs.pairs.size(), 1u);  // The third row has nothing.
  EXPECT_NEAR(pairs.pairs[0].test.difference.value, 0.6 - 0.9, 1e-12);
  EXPECT_EQ(pairs.note, "");
  fake.Evaluate(3, "test", {"SSSSS", "SSSSS", "SSSSC"});
  const RowPairs fewer = CompareRows(fake.Results().scores[0]);
  EXPECT_TRUE(fewer.pairs.empty());
  EXPECT_THAT(fewer.note, HasSubstr("1 pair of rows is left out"));
}

}  // namespace
}  // namespace slalom::sweep
