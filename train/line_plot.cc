#include "train/line_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace slalom::train {
namespace {

constexpr double kWidth = 760.0;
constexpr double kHeight = 400.0;
constexpr double kLeft = 56.0;
constexpr double kRight = 150.0;
constexpr double kTop = 40.0;
constexpr double kBottom = 48.0;
constexpr int kNumXTicks = 6;

/// The smallest of 1, 2, 5 times a power of ten that is at least `x`.
double RoundUp(double x) {
  const double power = std::pow(10.0, std::floor(std::log10(x)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= x * (1.0 - 1e-9)) return factor * power;
  }
  return 10.0 * power;
}

std::string Escape(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '<') {
      out += "&lt;";
    } else if (c == '&') {
      out += "&amp;";
    } else {
      out += c;
    }
  }
  return out;
}

}  // namespace

std::string DrawRatePlot(const std::string& title, const std::string& x_label,
                         const std::vector<PlotSeries>& series) {
  double x_max = 0.0;
  for (const PlotSeries& s : series) {
    for (const double x : s.x) x_max = std::max(x_max, x);
  }
  const double tick = RoundUp(std::max(x_max, 1e-9) / kNumXTicks);
  const double plot_width = kWidth - kLeft - kRight;
  const double plot_height = kHeight - kTop - kBottom;
  const auto to_x = [&](double x) { return kLeft + plot_width * x / std::max(x_max, 1e-9); };
  const auto to_y = [&](double y) { return kTop + plot_height * (1.0 - y); };

  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} "
      "{1}\" "
      "font-family=\"sans-serif\" font-size=\"12\">\n"
      "<rect width=\"{0}\" height=\"{1}\" fill=\"white\"/>\n"
      "<text x=\"{2}\" y=\"24\" font-size=\"15\">{3}</text>\n",
      kWidth, kHeight, kLeft, Escape(title));
  for (int i = 0; i <= 5; ++i) {
    const double y = to_y(0.2 * i);
    svg += fmt::format(
        "<line x1=\"{}\" y1=\"{y:.1f}\" x2=\"{}\" y2=\"{y:.1f}\" stroke=\"#ddd\"/>"
        "<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{}%</text>\n",
        kLeft, kLeft + plot_width, kLeft - 6, y + 4, 20 * i, fmt::arg("y", y));
  }
  for (double x = 0.0; x <= x_max * (1.0 + 1e-9); x += tick) {
    svg += fmt::format(
        "<line x1=\"{x:.1f}\" y1=\"{}\" x2=\"{x:.1f}\" y2=\"{}\" stroke=\"#ddd\"/>"
        "<text x=\"{x:.1f}\" y=\"{}\" text-anchor=\"middle\">{:g}</text>\n",
        kTop, kTop + plot_height, kTop + plot_height + 16, x, fmt::arg("x", to_x(x)));
  }
  svg += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n",
                     kLeft + plot_width / 2, kHeight - 10, Escape(x_label));
  int line = 0;
  for (const PlotSeries& s : series) {
    std::string points;
    bool pen_down = false;
    for (std::size_t i = 0; i < s.x.size(); ++i) {
      if (std::isnan(s.y[i])) {
        pen_down = false;
        continue;
      }
      points += fmt::format("{}{:.1f} {:.1f}", pen_down ? "L" : "M", to_x(s.x[i]), to_y(s.y[i]));
      pen_down = true;
    }
    svg += fmt::format(
        "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.8\"/>\n"
        "<text x=\"{}\" y=\"{}\" fill=\"{}\">{}</text>\n",
        points, s.colour, kLeft + plot_width + 10, kTop + 14 + 18 * line++, s.colour,
        Escape(s.name));
  }
  return svg + "</svg>\n";
}

}  // namespace slalom::train
