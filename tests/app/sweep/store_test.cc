#include "app/sweep/store.h"

#include <gtest/gtest.h>

#include "app/sweep/claim.h"
#include "app/sweep/estimate.h"
#include "base/error.h"
#include "base/file.h"
#include "tests/app/sweep/plan_files.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sweep {
namespace {

const std::string kPlan = std::string(test::kSweep) + test::kTinyScore;

TEST(StoreTest, TheStateOfACellFollowsFromItsFiles) {
  const test::ScratchDirectory scratch;
  const Cells cells = test::Expand(scratch.path(), kPlan);
  const Cell& cell = cells.cells[0];
  const CellDirectory directory(scratch.path(), cell.id);
  const auto state = [&] { return ReadCellStatus(scratch.path(), cell).state; };
  EXPECT_EQ(state(), CellState::kWaiting);
  auto claim = ClaimTaker().Try(directory.root());
  EXPECT_EQ(state(), CellState::kTraining);
  base::MakeDirectories(directory.run());
  base::WriteFileAtomically(directory.run() / "metrics.csv",
                            "training_s,steps,updates\n1.0,100,3\n2.0,200,6\n3.0,3");
  EXPECT_EQ(ReadCellStatus(scratch.path(), cell).steps, 200) << "the last row is not whole";
  WriteTrained(directory, {.steps = 4000, .updates = 9, .training_s = 8.0});
  EXPECT_EQ(state(), CellState::kScoring);
  EXPECT_EQ(ReadCellStatus(scratch.path(), cell).trained->steps, 4000);
  claim.reset();
  EXPECT_EQ(state(), CellState::kWaiting);
  WriteFailure(directory, {.what = "no", .log = "\xff"});
  EXPECT_EQ(state(), CellState::kFailed);
  EXPECT_FALSE(IsDone(scratch.path(), cell));
  base::MakeDirectories(directory.score(cell.scores[0]));
  base::WriteFileAtomically(directory.score(cell.scores[0]) / "evaluation.json", "{}");
  EXPECT_EQ(state(), CellState::kDone);
  EXPECT_TRUE(IsDone(scratch.path(), cell));
}

TEST(StoreTest, AStepsCountIsFoundInALongFile) {
  const test::ScratchDirectory scratch;
  const Cells cells = test::Expand(scratch.path(), kPlan);
  const CellDirectory directory(scratch.path(), cells.cells[0].id);
  base::MakeDirectories(directory.run());
  std::string rows = "training_s,steps,updates\n";
  for (int i = 1; i <= 5000; ++i) rows += std::to_string(i) + "," + std::to_string(10 * i) + ",1\n";
  base::WriteFileAtomically(directory.run() / "metrics.csv", rows);
  EXPECT_EQ(ReadCellStatus(scratch.path(), cells.cells[0]).steps, 50000);
}

TEST(StoreTest, StagesCountAsPartOfTheirTraining) {
  const test::ScratchDirectory scratch;
  Cell cell = test::Expand(scratch.path(), kPlan).cells[0];
  test::AddStages(cell);
  const CellDirectory directory(scratch.path(), cell.id);
  const auto write = [](const std::filesystem::path& run, const std::string& last_row) {
    base::MakeDirectories(run);
    base::WriteFileAtomically(run / "metrics.csv", "training_s,steps,updates\n" + last_row + "\n");
  };
  write(directory.run() / "stages/first", "1.0,1000,3");
  write(directory.run() / "stages/second", "1.0,500,3");
  EXPECT_EQ(ReadCellStatus(scratch.path(), cell).steps, 1500);
  write(directory.run(), "1.0,70,3");
  EXPECT_EQ(ReadCellStatus(scratch.path(), cell).steps, 1570);

  WriteTrained(directory, {.steps = 4000,
                           .updates = 9,
                           .training_s = 8.0,
                           .stages = {.steps = 3000, .updates = 7, .training_s = 6.0}});
  const CellStatus trained = ReadCellStatus(scratch.path(), cell);
  EXPECT_EQ(trained.steps, 7000);
  EXPECT_EQ(trained.trained->total().updates, 16);
  EXPECT_DOUBLE_EQ(trained.trained->total().training_s, 14.0);
  Rates rates;
  rates.Observe(cell, trained);
  EXPECT_DOUBLE_EQ(*rates.SecondsLeft(cell, 3500, 1), 7.0);
}

TEST(StoreTest, CellsThatThePlanNoLongerHasAreStale) {
  const test::ScratchDirectory scratch;
  const auto plan = ReadPlan(test::WritePlan(scratch.path(), kPlan), {});
  const train::Platform platform{.blas_kernel = "k", .processor = "p"};
  const Cells cells = ExpandPlan(plan, platform);
  EXPECT_EQ(CountStale(scratch.path(), plan, cells), 0);
  BeginPlan(scratch.path(), plan, cells, platform, "abc");
  EXPECT_EQ(CountStale(scratch.path(), plan, cells), 0);
  Cells fewer = cells;
  fewer.cells.pop_back();
  EXPECT_EQ(CountStale(scratch.path(), plan, fewer), 1);
}

TEST(StoreTest, WorkersOfAnotherVersionOrMachineAreRefusedWhileOthersWork) {
  const test::ScratchDirectory scratch;
  const auto plan = ReadPlan(test::WritePlan(scratch.path(), kPlan), {});
  const train::Platform here{.blas_kernel = "k", .processor = "p"};
  const train::Platform other{.blas_kernel = "k", .processor = "p2"};
  const Cells cells = ExpandPlan(plan, here);
  BeginPlan(scratch.path(), plan, cells, here, "abc");
  EXPECT_NO_THROW(BeginPlan(scratch.path(), plan, cells, other, "def")) << "nobody works";
  BeginPlan(scratch.path(), plan, cells, here, "abc");
  const auto claim = ClaimTaker().Try(CellDirectory(scratch.path(), cells.cells[0].id).root());
  EXPECT_NO_THROW(BeginPlan(scratch.path(), plan, cells, here, "abc"));
  EXPECT_THROW(BeginPlan(scratch.path(), plan, cells, here, "def"), base::Error);
  EXPECT_THROW(BeginPlan(scratch.path(), plan, cells, other, "abc"), base::Error);
  auto mixed = plan;
  mixed.sweep.mixed_platforms = true;
  EXPECT_NO_THROW(BeginPlan(scratch.path(), mixed, cells, other, "abc"));
}

TEST(EstimateTest, TimeLeftFollowsFromWhatIsDone) {
  const test::ScratchDirectory scratch;
  const Cells cells = test::Expand(scratch.path(), kPlan);
  Rates rates;
  EXPECT_FALSE(rates.SecondsLeft(cells.cells[0], 0, 0).has_value());
  CellStatus done;
  done.trained = TrainedCell{.steps = 4000, .training_s = 8.0};
  done.scored = ScoredCell{.wall_s = 3.0, .episodes = 2};
  rates.Observe(cells.cells[0], done);
  EXPECT_DOUBLE_EQ(*rates.SecondsLeft(cells.cells[1], 0, 0), 8.0 + 3.0);
  EXPECT_DOUBLE_EQ(*rates.SecondsLeft(cells.cells[1], 1000, 0), 6.0 + 3.0);
  EXPECT_DOUBLE_EQ(*rates.SecondsLeft(cells.cells[1], 4000, 1), 0.0);
}

}  // namespace
}  // namespace slalom::sweep
