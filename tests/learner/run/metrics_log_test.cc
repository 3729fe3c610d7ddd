#include "learner/run/metrics_log.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <map>
#include <sstream>

#include "base/error.h"
#include "base/file.h"
#include "learner/run/metrics_table.h"
#include "tests/support/event_file_reader.h"
#include "tests/support/log_lines.h"
#include "tests/support/scratch_directory.h"
#include "tests/support/small_files.h"

namespace slalom::run {
namespace {

std::vector<std::string> Lines(const std::filesystem::path& path) {
  std::istringstream in(base::ReadFile(path));
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

MetricsRow RowAt(std::int64_t steps) {
  MetricsRow row;
  row.training_s = 1.5;
  row.steps = steps;
  return row;
}

TEST(MetricsLogTest, EveryRowHasAsManyCellsAsTheHeader) {
  const test::ScratchDirectory scratch;
  const auto path = scratch.path() / "metrics.csv";
  MetricsLog log(path, 0);
  MetricsRow row = RowAt(64);
  row.success_rate = std::numeric_limits<double>::quiet_NaN();
  log.Append(row);
  const auto lines = Lines(path);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(std::count(lines[0].begin(), lines[0].end(), ','),
            std::count(lines[1].begin(), lines[1].end(), ','));
  EXPECT_THAT(lines[1], testing::StartsWith("1.50,64,0,0,0,0.0,,"));
}

TEST(MetricsLogTest, AResumedRunWritesAnewWhatCameAfterItsCheckpoint) {
  const test::ScratchDirectory scratch;
  const auto path = scratch.path() / "metrics.csv";
  {
    MetricsLog log(path, 0);
    for (const int steps : {100, 200, 300}) log.Append(RowAt(steps));
  }
  // As a kill in the middle of a line leaves it.
  base::WriteFileAtomically(path, base::ReadFile(path) + "2.0,190");
  MetricsLog log(path, 200);
  log.Append(RowAt(250));
  const auto lines = Lines(path);
  ASSERT_EQ(lines.size(), 4u);
  EXPECT_THAT(lines[2], testing::StartsWith("1.50,200,"));
  EXPECT_THAT(lines[3], testing::StartsWith("1.50,250,"));
  std::vector<std::int64_t> events;
  for (const test::Event& event : test::ReadRun(scratch.path())) events.push_back(event.step);
  EXPECT_THAT(events, testing::ElementsAre(100, 200, 250));
}

std::vector<std::string> Cells(const std::string& line) {
  std::istringstream in(line + ",");
  std::vector<std::string> cells;
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

TEST(MetricsLogTest, TheEventFileHoldsEveryCell) {
  const test::ScratchDirectory scratch;
  const auto path = scratch.path() / "metrics.csv";
  // Numbers that a cell and a float32 hold whole.
  MetricsRow row{1.5,  640,  160,   12, 512.0, 128.0, 0.75, 0.125,
                 0.25, 24.5, 120.0, 40, 0.5,   0.25,  600,  {}};
  row.learning.critic_loss = 0.375;
  row.learning.model.inside_50 = 0.5;
  MetricsLog log(path, 0);
  log.Append(row);
  row.steps = 1280;
  row.episode_return = std::numeric_limits<double>::quiet_NaN();
  log.Append(row);

  const auto lines = Lines(path);
  const auto names = Cells(lines.at(0));
  const auto events = test::ReadRun(scratch.path());
  ASSERT_EQ(events.size(), 2u);
  for (std::size_t i = 0; i < events.size(); ++i) {
    const auto cells = Cells(lines.at(i + 1));
    std::map<std::string, float> expected;
    for (std::size_t c = 0; c < names.size(); ++c) {
      if (!cells[c].empty()) expected["training/" + names[c]] = std::stof(cells[c]);
    }
    EXPECT_EQ(events[i].scalars, expected);
    EXPECT_EQ(events[i].scalars.size(), 18u - i) << "the second row has an empty cell";
    EXPECT_EQ(events[i].step, std::stoll(cells.at(1)));
  }
}

TEST(MetricsLogTest, RowsThatAreKeptGoToTheColumnsOfTheirNames) {
  const test::ScratchDirectory scratch;
  const auto path = scratch.path() / "metrics.csv";
  base::WriteFileAtomically(path,
                            "training_s,steps,q_mean,critic_loss,episode_return,unknown\n"
                            "2.00,100,7.5,0.25,3,90\n4.00,200,8.5,,4,180\n");
  const MetricsLog log(path, 100);
  const MetricsTable table = ParseMetrics(base::ReadFile(path), 0);
  ASSERT_EQ(table.num_rows(), 1u);
  EXPECT_EQ(table.Last("training_s"), 2.0);
  EXPECT_EQ(table.Last("steps"), 100.0);
  EXPECT_EQ(table.Last("q_mean"), 7.5);
  EXPECT_EQ(table.Last("critic_loss"), 0.25);
  EXPECT_EQ(table.Last("episode_return"), 3.0);
  EXPECT_EQ(std::ranges::count(table.names, "unknown"), 0);
  EXPECT_TRUE(std::isnan(table.Last("updates")));
}

TEST(MetricsLogTest, OnAFullDiskRowsAreLeftOutAndThoseThatComeAfterAreWhole) {
  const test::ScratchDirectory scratch;
  const auto path = scratch.path() / "metrics.csv";
  MetricsLog log(path, 0);
  log.Append(RowAt(1));
  for (const int row : {2, 4}) {
    {
      const test::LogLines said;
      const test::SmallFiles limit(std::filesystem::file_size(path) + 5);
      log.Append(RowAt(row));
      EXPECT_TRUE(said.Has("rows are left out")) << row;
    }
    log.Append(RowAt(row + 1));
  }
  const auto lines = Lines(path);
  ASSERT_EQ(lines.size(), 4u);
  EXPECT_THAT(lines[1], testing::StartsWith("1.50,1,"));
  EXPECT_THAT(lines[2], testing::StartsWith("1.50,3,"));
  EXPECT_THAT(lines[3], testing::StartsWith("1.50,5,"));
  EXPECT_EQ(test::ReadRun(scratch.path()).size(), 3u);
}

TEST(MetricsLogTest, AnUnwritablePlaceIsNamed) {
  try {
    MetricsLog log("/nonexistent/metrics.csv", 0);
    FAIL() << "expected an error";
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("/nonexistent/metrics.csv"));
  }
}

TEST(FormatProgressTest, ShowsWhatMatters) {
  MetricsRow row = RowAt(1'250'000);
  row.steps_per_s = 43'210;
  row.success_rate = 0.954;
  row.collision_rate = 0.04;
  const std::string text = FormatProgress(row, 65.0);
  EXPECT_THAT(text, testing::HasSubstr("1.25M steps (43.2k/s)"));
  EXPECT_THAT(text, testing::HasSubstr("success  95%"));
  EXPECT_THAT(text, testing::HasSubstr("left 1:05"));
  EXPECT_LE(FormatProgress(row, 36'000.0).size(), 79u) << "wraps on a narrow terminal";
}

}  // namespace
}  // namespace slalom::run
