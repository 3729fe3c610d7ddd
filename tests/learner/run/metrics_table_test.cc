#include "learner/run/metrics_table.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "base/file.h"
#include "tests/support/scratch_directory.h"

namespace slalom::run {
namespace {

using ::testing::ElementsAre;
using ::testing::IsNan;

TEST(MetricsTableTest, LinesThatAreNotWholeAreLeftOut) {
  const std::string whole = "training_s,steps,loss\n1.5,100,\n2.5,200,0.5\n";
  const MetricsTable table = ParseMetrics(whole, 100);
  EXPECT_THAT(table.names, ElementsAre("training_s", "steps", "loss"));
  EXPECT_THAT(table.columns[1], ElementsAre(100.0, 200.0));
  EXPECT_TRUE(std::isnan(table.columns[2][0]));
  EXPECT_EQ(table.Last("loss"), 0.5);
  EXPECT_TRUE(std::isnan(table.Last("none")));
  EXPECT_THAT(table.Column("steps"), ElementsAre(100.0, 200.0));
  EXPECT_THAT(table.Column("none"), ElementsAre(IsNan(), IsNan()));
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

TEST(MetricsTableTest, TheLastRowOfALongFileIsWhole) {
  const test::ScratchDirectory scratch;
  const std::filesystem::path path = scratch.path() / "metrics.csv";
  EXPECT_EQ(ReadLastMetrics(path).num_rows(), 0u) << "there is no file";
  std::string text = "steps,loss\n";
  for (int i = 1; i <= 5000; ++i) text += std::to_string(i) + ",0." + std::to_string(i) + "\n";
  // Wherever the part that is read begins within a row, and however far the writer has come.
  for (int more = 0; more < 20; ++more) {
    base::WriteFileAtomically(path, text + std::string(static_cast<std::size_t>(more), '7'));
    const MetricsTable table = ReadLastMetrics(path);
    EXPECT_EQ(table.Last("steps"), 5000.0);
    EXPECT_EQ(table.Last("loss"), 0.5);
    EXPECT_EQ(table.Column("steps").front() + static_cast<double>(table.num_rows()), 5001.0);
    EXPECT_LT(table.num_rows(), 300u);
  }
}

// The page asks again and again while a run writes for weeks.
TEST(MetricsTableTest, OfALongFileOnlyAFewRowsAreRead) {
  const test::ScratchDirectory scratch;
  const std::filesystem::path path = scratch.path() / "metrics.csv";
  constexpr int kRows = 100000;
  {
    std::ofstream file(path);
    file << "training_s,steps\n";
    for (int i = 0; i < kRows; ++i) file << i << "," << 10 * i << "\n";
    file << "123,";
  }
  const MetricsTable table = ReadMetrics(path, 5);
  ASSERT_EQ(table.num_rows(), 5u);
  EXPECT_EQ(table.columns[0].front(), 0.0);
  EXPECT_EQ(table.Last("training_s"), kRows - 1);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(table.columns[0][i], kRows * static_cast<double>(i) / 4.0, 0.04 * kRows);
    EXPECT_EQ(table.columns[1][i], 10.0 * table.columns[0][i]);
  }
  EXPECT_EQ(ReadMetrics(path, 2).columns[0], (std::vector<double>{0.0, kRows - 1}));
  // What lies between the rows that are shown is not read: here 64 GiB of nothing.
  std::filesystem::resize_file(path, std::uintmax_t{1} << 36);
  std::ofstream(path, std::ios::app) << "\n200000,7\n";
  EXPECT_EQ(ReadMetrics(path, 5).columns[0], (std::vector<double>{0.0, 200000.0}));
}

TEST(MetricsTableTest, AShortFileIsReadAsAWhole) {
  const test::ScratchDirectory scratch;
  const std::filesystem::path path = scratch.path() / "metrics.csv";
  EXPECT_EQ(ReadMetrics(path, 100).num_rows(), 0u) << "there is no file";
  std::ofstream(path) << "a,b\n";
  EXPECT_EQ(ReadMetrics(path, 100).num_rows(), 0u);
  std::ofstream(path, std::ios::app) << "1,2\n3,4\n5,";
  EXPECT_EQ(ReadMetrics(path, 100).columns[1], (std::vector<double>{2.0, 4.0}));
}

}  // namespace
}  // namespace slalom::run
