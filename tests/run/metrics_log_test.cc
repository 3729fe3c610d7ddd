#include "run/metrics_log.h"

#include <gmock/gmock.h>

#include <limits>
#include <sstream>

#include "base/error.h"
#include "base/file.h"
#include "tests/support/scratch_directory.h"

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
  EXPECT_THAT(text, testing::HasSubstr("1.25M steps (43k/s)"));
  EXPECT_THAT(text, testing::HasSubstr("success  95%"));
  EXPECT_THAT(text, testing::HasSubstr("left 1:05"));
  EXPECT_LE(FormatProgress(row, 36'000.0).size(), 79u) << "wraps on a narrow terminal";
}

}  // namespace
}  // namespace slalom::run
