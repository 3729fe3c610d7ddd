#include "app/watch/run_progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <optional>
#include <string>

#include "base/file.h"
#include "learner/run/metrics_log.h"
#include "learner/run/run_directory.h"
#include "tests/support/scratch_directory.h"

namespace slalom::watch {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

void Age(const fs::path& file) {
  fs::last_write_time(file, fs::file_time_type::clock::now() - std::chrono::hours(1));
}

TEST(RunProgressTest, ReadsWhatARunWrites) {
  const test::ScratchDirectory scratch;
  {
    run::MetricsLog log(scratch.path() / "metrics.csv", 0);
    run::MetricsRow row;
    row.training_s = 20.0;
    row.steps = 5000;
    row.success_rate = 0.25;
    log.Append(row);
  }
  const auto run = ReadRun(scratch.path(), {.max_steps = 20000, .max_seconds = 50.0}, 100);
  ASSERT_TRUE(run);
  EXPECT_EQ(run->name, scratch.path().filename());
  EXPECT_EQ(run->state, RunState::kTraining);
  EXPECT_EQ(run->metrics.Last("success_rate"), 0.25);
  // 20 of 50 s have gone by, which is more than 5000 of 20000 steps.
  ASSERT_TRUE(run->left_s);
  EXPECT_NEAR(*run->left_s, 30.0, 1e-9);
}

TEST(RunProgressTest, TellsTrainingFromStoppedAndFinished) {
  const test::ScratchDirectory scratch;
  const fs::path file = scratch.path() / "metrics.csv";
  const auto state = [&](double max_seconds) {
    return ReadRun(scratch.path(), {.max_seconds = max_seconds}, 100)->state;
  };
  base::WriteFileAtomically(file, "training_s,steps\n");
  EXPECT_EQ(state(0.0), RunState::kStarting);
  base::WriteFileAtomically(file, "training_s,steps\n10,100\n");
  Age(file);
  EXPECT_EQ(state(0.0), RunState::kStopped);
  EXPECT_EQ(state(20.0), RunState::kStopped);
  EXPECT_EQ(state(10.0), RunState::kFinished);
  {
    const run::RunLock lock(scratch.path());
    EXPECT_EQ(state(20.0), RunState::kTraining) << "held, as a run between two rows";
  }
  EXPECT_EQ(state(20.0), RunState::kStopped);
}

TEST(RunProgressTest, TheCellsOfASweepAreRunsWithNamesOfTheirRows) {
  const test::ScratchDirectory scratch;
  const fs::path cell = scratch.path() / "cells/0123";
  base::MakeDirectories(cell / "run");
  base::MakeDirectories(scratch.path() / "plans/p");
  base::WriteFileAtomically(cell / "run/config.toml", "");
  EXPECT_EQ(NameOf(cell / "run"), "run");
  base::WriteFileAtomically(cell / "cell.json", R"({"row": "GRU / 4", "seed": 2})");
  EXPECT_THAT(ListRuns(scratch.path()), ElementsAre(cell / "run"));
  EXPECT_THAT(ListRuns(scratch.path() / "cells"), ElementsAre(cell / "run"));
  EXPECT_EQ(NameOf(cell / "run"), "GRU / 4, seed 2 (0123)");
  base::WriteFileAtomically(cell / "cell.json", "{}");
  EXPECT_EQ(NameOf(cell / "run"), "0123");
}

TEST(RunProgressTest, ARunMayComeAndGo) {
  const test::ScratchDirectory scratch;
  const fs::path run = scratch.path() / "run";
  EXPECT_FALSE(ReadRun(run, {}, 100));
  EXPECT_THAT(ListRuns(scratch.path()), IsEmpty());
  EXPECT_THAT(ListRuns(run), IsEmpty());
  base::MakeDirectories(run);
  base::MakeDirectories(scratch.path() / "other");
  base::WriteFileAtomically(run / "config.toml", "");
  EXPECT_THAT(ListRuns(scratch.path()), ElementsAre(run));
  EXPECT_THAT(ListRuns(run), ElementsAre(run));
  EXPECT_EQ(NameOf(run / ""), "run");
  const auto begun = ReadRun(run, {}, 100);
  ASSERT_TRUE(begun);
  EXPECT_EQ(begun->metrics.num_rows(), 0u);
  EXPECT_FALSE(begun->left_s);
  fs::remove_all(run);
  EXPECT_FALSE(ReadRun(run, {}, 100));
}

}  // namespace
}  // namespace slalom::watch
