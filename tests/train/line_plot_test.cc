#include "train/line_plot.h"

#include <gmock/gmock.h>

#include <limits>

namespace slalom::train {
namespace {

TEST(LinePlotTest, PointsLieWhereTheirValuesSay) {
  const std::string svg =
      DrawRatePlot("t", "x", {{"line", "#123456", {0.0, 50.0, 100.0}, {0.0, 0.5, 1.0}}});
  // Axes: x from 56 to 610 for 0 to 100, y from 352 to 40 for 0 to 1.
  EXPECT_THAT(svg, testing::HasSubstr("d=\"M56.0 352.0L333.0 196.0L610.0 40.0\""));
  EXPECT_THAT(svg, testing::HasSubstr("#123456"));
}

TEST(LinePlotTest, AnUnknownValueLeavesAGap) {
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  const std::string svg =
      DrawRatePlot("t", "x", {{"line", "red", {0.0, 50.0, 100.0}, {0.0, unknown, 1.0}}});
  EXPECT_THAT(svg, testing::HasSubstr("d=\"M56.0 352.0M610.0 40.0\""));
}

TEST(LinePlotTest, TitlesAreEscapedAndNoDataIsNoCrash) {
  const std::string svg = DrawRatePlot("a < b & c", "x", {{"line", "red", {}, {}}});
  EXPECT_THAT(svg, testing::HasSubstr("a &lt; b &amp; c"));
}

}  // namespace
}  // namespace slalom::train
