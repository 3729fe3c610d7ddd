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

TEST(RunProgressTest, ARunShowsTheStageThatIsTrained) {
  const test::ScratchDirectory scratch;
  const fs::path first = scratch.path() / "stages/a", second = scratch.path() / "stages/b";
  const auto read = [&] {
    return ReadRun(scratch.path(), {.max_steps = 100, .stages = {{"a", first}, {"b", second}}}, 9)
        .value();
  };
  const auto write = [](const fs::path& run, const std::string& row) {
    base::MakeDirectories(run);
    base::WriteFileAtomically(run / "metrics.csv", "training_s,steps\n" + row + "\n");
    Age(run / "metrics.csv");
  };
  base::WriteFileAtomically(scratch.path() / "config.toml", "");
  const std::optional<run::RunLock> lock(scratch.path());
  EXPECT_EQ(read().state, RunState::kStarting);
  EXPECT_EQ(read().stage, "");
  write(first, "10,100");
  EXPECT_EQ(read().state, RunState::kTraining) << "at its own limit, and another one follows";
  EXPECT_EQ(read().stage, "a (1 of 2)");
  EXPECT_EQ(read().metrics.Last("steps"), 100.0);
  EXPECT_FALSE(read().left_s) << "the next stage takes time, too";
  base::MakeDirectories(second);
  base::WriteFileAtomically(second / "config.toml", "");
  EXPECT_EQ(read().state, RunState::kStarting);
  EXPECT_EQ(read().stage, "b (2 of 2)");
  write(scratch.path(), "5,50");
  EXPECT_EQ(read().stage, "");
  EXPECT_EQ(read().metrics.Last("steps"), 50.0);
  EXPECT_EQ(read().left_s, 5.0);
}

TEST(RunProgressTest, AStoppedStageIsNoFinishedRun) {
  const test::ScratchDirectory scratch;
  base::MakeDirectories(scratch.path() / "a");
  base::WriteFileAtomically(scratch.path() / "config.toml", "");
  base::WriteFileAtomically(scratch.path() / "a/metrics.csv", "training_s,steps\n10,100\n");
  Age(scratch.path() / "a/metrics.csv");
  const auto run =
      ReadRun(scratch.path(), {.max_steps = 100, .stages = {{"a", scratch.path() / "a"}}}, 9);
  EXPECT_EQ(run->state, RunState::kStopped);
  EXPECT_EQ(run->stage, "a (1 of 1)");
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
