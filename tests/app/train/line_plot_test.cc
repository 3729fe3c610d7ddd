#include "app/train/line_plot.h"

#include <gmock/gmock.h>

#include <limits>

namespace slalom::plot {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

Figure FigureOf(const Series& series, bool is_rate = true) {
  Figure figure;
  figure.title = "t";
  figure.x_label = "x";
  figure.panels = {{"panel", is_rate, {series}}};
  return figure;
}

TEST(LinePlotTest, PointsLieWhereTheirValuesSay) {
  const std::string svg =
      DrawFigure(FigureOf({"line", Colour::kGreen, {0.0, 50.0, 100.0}, {0.0, 0.5, 1.0}}));
  // Axes: x from 64 to 610 for 0 to 100, y from 230 to 80 for 0 to 1.
  EXPECT_THAT(svg, HasSubstr("class=\"line green\" d=\"M64.0 230.0L337.0 155.0L610.0 80.0\""));
  EXPECT_THAT(svg, HasSubstr(">line 100.0 %<"));
}

TEST(LinePlotTest, ValuesThatAreNoRatesGetRoundEnds) {
  // From -30 to 50 in steps of 20: -40 to 60, so 0 lies at 230 - 150 * 40 / 100.
  const std::string svg =
      DrawFigure(FigureOf({"line", Colour::kBlue, {0.0, 50.0, 100.0}, {-30.0, 0.0, 50.0}}, false));
  EXPECT_THAT(svg, HasSubstr("d=\"M64.0 215.0L337.0 170.0L610.0 95.0\""));
  EXPECT_THAT(svg, HasSubstr(">-40<"));
  EXPECT_THAT(svg, HasSubstr(">60<"));
}

TEST(LinePlotTest, AnUnknownValueLeavesAGap) {
  const std::string svg =
      DrawFigure(FigureOf({"line", Colour::kRed, {0.0, 50.0, 100.0}, {0.0, kUnknown, 1.0}}));
  EXPECT_THAT(svg, HasSubstr("d=\"M64.0 230.0M610.0 80.0\""));
}

TEST(LinePlotTest, APointHasItsIntervalAndDot) {
  Series series{"line", Colour::kGreen, {50.0, 100.0}, {0.5, 0.5}, {0.2, kUnknown}, {0.6, 1.0}};
  series.has_dots = true;
  const std::string svg = DrawFigure(FigureOf(series));
  EXPECT_THAT(svg, HasSubstr("x1=\"337.0\" x2=\"337.0\" y1=\"200.0\" y2=\"140.0\""));
  EXPECT_THAT(svg, HasSubstr("cx=\"337.0\" cy=\"155.0\""));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

TEST(LinePlotTest, TheSecondScaleReadsAtTheFirstsTicks) {
  Figure figure = FigureOf({"line", Colour::kGreen, {0.0, 100.0}, {0.0, 1.0}});
  figure.top_label = "steps";
  figure.top_x = {20.0, 100.0};
  figure.top_values = {1000.0, 1'001'000.0};
  const std::string svg = DrawFigure(figure);
  // Ticks every 20: 0, 1000, then 250,000 more each.
  for (const char* label : {">0<", ">1k<", ">251k<", ">501k<", ">751k<", ">1M<", ">steps<"}) {
    EXPECT_THAT(svg, HasSubstr(label));
  }
}

TEST(LinePlotTest, EmptyPanelsAreLeftOut) {
  Figure figure = FigureOf({"line", Colour::kGreen, {0.0, 100.0}, {0.0, 1.0}});
  figure.panels.push_back({"nothing known", false, {{"x", Colour::kRed, {1.0}, {kUnknown}}}});
  EXPECT_THAT(DrawFigure(figure), Not(HasSubstr("nothing known")));
  figure.panels.erase(figure.panels.begin());
  EXPECT_THAT(DrawFigure(figure), HasSubstr("No episode has ended yet."));
  EXPECT_THAT(DrawFigure({}), HasSubstr("</svg>"));
}

TEST(LinePlotTest, TextsAreEscaped) {
  Figure figure = FigureOf({"<script>", Colour::kRed, {1.0}, {1.0}});
  figure.title = "a < b & c\x01";
  const std::string svg = DrawFigure(figure);
  EXPECT_THAT(svg, HasSubstr(">a &lt; b &amp; c<"));
  EXPECT_THAT(svg, Not(HasSubstr("<script")));
}

}  // namespace
}  // namespace slalom::plot
