#include "learner/run/metrics_table.h"

#include <gmock/gmock.h>

#include <cmath>
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

}  // namespace
}  // namespace slalom::run
