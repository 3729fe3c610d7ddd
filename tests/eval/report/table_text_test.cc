#include "eval/report/table_text.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

namespace slalom::eval {
namespace {

TEST(TableText, RoundsHalvesAwayFromZero) {
  EXPECT_EQ(FixedText(36.25, 1), "36.3");
  EXPECT_EQ(FixedText(-36.25, 1), "-36.3");
  EXPECT_EQ(FixedText(36.75, 1), "36.8");
  EXPECT_EQ(FixedText(0.5, 0), "1");
  EXPECT_EQ(FixedText(99.95, 1), "100.0");  // 99.9500000000000028 in binary.
  EXPECT_EQ(FixedText(-0.04, 1), "0.0");
  // Just below and above a half, and 36.35, which is 36.35000000000000142 in binary.
  EXPECT_EQ(FixedText(std::nextafter(36.25, 0.0), 1), "36.2");
  EXPECT_EQ(FixedText(std::nextafter(36.25, 99.0), 1), "36.3");
  EXPECT_EQ(FixedText(36.35, 1), "36.4");
  // 1.45 is 1.4499999999999999556 in binary, though ten times that is 14.5.
  EXPECT_EQ(FixedText(1.45, 1), "1.4");
  // Multiples of 1/16, rounded in integers.
  for (int k = 0; k < 5000; ++k) {
    const int tenths = (2 * 10 * k + 16) / 32;
    EXPECT_EQ(FixedText(k / 16.0, 1), fmt::format("{}.{}", tenths / 10, tenths % 10)) << k;
  }
}

TEST(TableText, ShowsDifferencesWithASignAndZeroWithout) {
  const auto text = [](double value, double low, double high) {
    return EstimateText(Estimate{value, Interval{low, high}}, 100.0, 1, true);
  };
  EXPECT_EQ(text(0.05, -0.0004, 0.1), "+5.0 (0.0 to +10.0)");
  EXPECT_EQ(text(-0.05, -0.1, 0.0006), "-5.0 (-10.0 to +0.1)");
  EXPECT_EQ(EstimateText(Estimate{-1.5, std::nullopt}, 2.0, 2, false), "-3.00");
  EXPECT_EQ(EstimateText(std::nullopt, 1.0, 1, true), "–");
  EXPECT_EQ(PValueText(0.0009), "\\< 0.001");
  EXPECT_EQ(PValueText(0.001), "0.001");
  const MarkdownTable table{.titles = {"a", "b", "c"}, .num_names = 2, .rows = {{"x", "y", "1"}}};
  EXPECT_EQ(table.Print(), "| a | b | c |\n|---|---|---:|\n| x | y | 1 |\n");
  const MarkdownTable wide{.titles = {"a", "±"}, .rows = {{"xyz", "1"}}};
  EXPECT_EQ(wide.PrintAligned(), "| a   | ± |\n|-----|---|\n| xyz | 1 |\n");
}

}  // namespace
}  // namespace slalom::eval
