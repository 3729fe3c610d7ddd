#include "watch/run_progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <optional>
#include <string>

#include "base/file.h"
#include "run/metrics_log.h"
#include "run/run_directory.h"
#include "tests/support/scratch_directory.h"

namespace slalom::watch {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

void Age(const fs::path& file) {
  fs::last_write_time(file, fs::file_time_type::clock::now() - std::chrono::hours(1));
}

TEST(MetricsTableTest, LinesThatAreNotWholeAreLeftOut) {
  const std::string whole = "training_s,steps,loss\n1.5,100,\n2.5,200,0.5\n";
  const MetricsTable table = ParseMetrics(whole, 100);
  EXPECT_THAT(table.names, ElementsAre("training_s", "steps", "loss"));
  EXPECT_THAT(table.columns[1], ElementsAre(100.0, 200.0));
  EXPECT_TRUE(std::isnan(table.columns[2][0]));
  EXPECT_EQ(table.Last("loss"), 0.5);
  EXPECT_TRUE(std::isnan(table.Last("none")));
  // However far the writer has come.
  for (std::size_t size = 0; size <= whole.size(); ++size) {
    const MetricsTable part = ParseMetrics(whole.substr(0, size), 100);
    EXPECT_EQ(part.num_rows(), size < 31 ? 0u : size < whole.size() ? 1u : 2u) << size;
    EXPECT_TRUE(part.num_rows() == 0 || part.columns[0][0] == 1.5);
  }
  EXPECT_EQ(ParseMetrics(whole + "3.5,30\n4.5,x,1\n\n5.5,300,1,9\n6.5,400,1\n", 100).columns[1],
            (std::vector<double>{100.0, 200.0, 400.0}));
}

TEST(MetricsTableTest, OfManyRowsSomeAreKeptTheLastAmongThem) {
  std::string text = "steps\n";
  for (int i = 0; i < 1000; ++i) text += std::to_string(i) + "\n";
  EXPECT_THAT(ParseMetrics(text, 4).columns[0], ElementsAre(0.0, 333.0, 666.0, 999.0));
  EXPECT_EQ(ParseMetrics(text, 1000).num_rows(), 1000u);
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
