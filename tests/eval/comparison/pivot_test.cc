#include "eval/comparison/pivot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace slalom::eval {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

PivotEntry Entry(std::size_t line, std::optional<std::size_t> column, double mean) {
  PivotEntry entry;
  entry.line = line;
  entry.column = column;
  entry.number.mean = mean;
  return entry;
}

TEST(PivotTest, ColumnsStandBelowBlocksAndANumberMayBeOfAllOfThem) {
  Pivot pivot{.corner = "success | all",
              .lines = {"MLP", "none", "GRU", "DWA"},
              .blocks = {"static", "walls"},
              .columns = {"H=1", "H=4"},
              .caption = "A table."};
  pivot.entries = {Entry(0, 0, 50.0), Entry(0, 1, 60.0), Entry(2, 1, 83.3), Entry(3, {}, 70.0)};
  pivot.entries[0].number.deviation = 2.0;
  pivot.entries[0].published = {{"the paper", {65.0, 4.0}}};
  pivot.entries[1].published = {{"another", {55.0, {}}}, {"the paper", {57.0, {}}}};
  pivot.entries[1].mark = "2/3";
  pivot.entries.push_back(Entry(3, {}, 20.0));
  pivot.entries.back().block = 1;
  EXPECT_EQ(
      MarkdownOf(pivot),
      "| success \\| all | static, H=1 | static, H=4 | walls, H=1 | walls, H=4 |\n"
      "|---|---:|---:|---:|---:|\n"
      "| MLP | 50.0 ± 2.0 | 60.0 (2/3 seeds) | – | – |\n"
      "| *the paper* | 65.0 ± 4.0 | 57.0 | – | – |\n"
      "| *another* | – | 55.0 | – | – |\n"
      "| GRU | – | **83.3** | – | – |\n"
      "| DWA | 70.0 |  | 20.0 |  |\n"
      "\n"
      "A table. Mean and standard deviation over seeds. The bold font marks the best. Lines in "
      "italics are published numbers. A fraction says how many of the planned seeds are in the "
      "number.\n");
}

TEST(PivotTest, EachContestHasItsBestAndThoseThatPrintAlike) {
  Pivot pivot{.corner = "a", .lines = {"x", "y", "z"}, .columns = {"s"}, .caption = "c"};
  pivot.entries = {Entry(0, 0, 12.34), Entry(1, 0, 12.31), Entry(2, 0, 12.4)};
  const std::string highest = MarkdownOf(pivot);
  EXPECT_THAT(highest, HasSubstr("| x | 12.3 |\n| y | 12.3 |\n| z | **12.4** |\n"));
  for (PivotEntry& entry : pivot.entries) entry.higher_is_better = false;
  EXPECT_THAT(MarkdownOf(pivot), HasSubstr("| x | **12.3** |\n| y | **12.3** |\n| z | 12.4 |\n"));
  pivot.entries[2].contest = 1;
  const std::string alike = MarkdownOf(pivot);
  EXPECT_THAT(alike, Not(HasSubstr("**")));
  EXPECT_THAT(alike, Not(HasSubstr("bold")));
}

TEST(PivotTest, ManyColumnsBecomeLines) {
  Pivot pivot{.corner = "success", .lines = {"TD3", "SAC", "without an entry"}};
  for (std::size_t c = 0; c < kMaxPivotColumns; ++c) {
    pivot.columns.push_back("s" + std::to_string(c));
    pivot.entries.push_back(Entry(1, c, static_cast<double>(c)));
  }
  FitToPage(pivot);
  EXPECT_EQ(pivot.lines.front(), "TD3");
  pivot.columns.emplace_back("without an entry");
  FitToPage(pivot);
  EXPECT_EQ(pivot.lines.front(), "TD3");
  pivot.columns.emplace_back("last");
  pivot.entries.push_back(Entry(0, kMaxPivotColumns + 1, 50.0));
  FitToPage(pivot);
  EXPECT_THAT(MarkdownOf(pivot), HasSubstr("| success | TD3 | SAC |\n|---|---:|---:|\n"
                                           "| s0 | – | 0.0 |\n| s1 | – | 1.0 |\n"));
  EXPECT_THAT(MarkdownOf(pivot), HasSubstr("| s11 | – | 11.0 |\n| last | **50.0** | – |\n"));
}

}  // namespace
}  // namespace slalom::eval
