#include "app/train/line_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string_view>
#include <vector>

namespace slalom::plot {
namespace {

// In pixels.
constexpr double kWidth = 760.0;
constexpr double kLeft = 64.0;
constexpr double kRight = 150.0;
constexpr double kTop = 40.0;           // The title.
constexpr double kTopScale = 30.0;      // The second scale.
constexpr double kPanelHeight = 150.0;  // Its lines.
constexpr double kPanelTitle = 30.0;
constexpr double kBottom = 48.0;  // The x axis.
constexpr double kPlotWidth = kWidth - kLeft - kRight;
constexpr int kNumXTicks = 6;
constexpr int kNumYTicks = 4;

constexpr std::string_view kStyle =
    "<style>\n"
    ".paper{fill:#ffffff}text{fill:#1d2530}.faint{fill:#5f6a78}.grid{stroke:#dde2e8}\n"
    ".green{color:#2a7f3f}.red{color:#c0392b}.amber{color:#a86a12}.blue{color:#1f6fb2}\n"
    ".line{fill:none;stroke:currentColor;stroke-width:1.8}\n"
    ".interval{stroke:currentColor;opacity:0.5}circle,.name{fill:currentColor}\n"
    "@media (prefers-color-scheme:dark){\n"
    ".paper{fill:#171c22}text{fill:#e4e9ef}.faint{fill:#9aa6b4}.grid{stroke:#2e3741}\n"
    ".green{color:#5cc47a}.red{color:#f07b6c}.amber{color:#e3b04b}.blue{color:#62b0ee}}\n"
    "</style>\n";

std::string_view ClassOf(Colour colour) {
  switch (colour) {
    case Colour::kGreen:
      return "green";
    case Colour::kRed:
      return "red";
    case Colour::kAmber:
      return "amber";
    case Colour::kBlue:
      break;
  }
  return "blue";
}

/// The smallest of 1, 2, 5 times a power of ten that is at least `x`.
double RoundUp(double x) {
  const double power = std::pow(10.0, std::floor(std::log10(x)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= x * (1.0 - 1e-9)) return factor * power;
  }
  return 10.0 * power;
}

/// Text for an element: markup is escaped, and control characters, which XML forbids, are left out.
std::string Escape(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '<') {
      out += "&lt;";
    } else if (c == '&') {
      out += "&amp;";
    } else if (static_cast<unsigned char>(c) >= 0x20) {
      out += c;
    }
  }
  return out;
}

/// "950", "12k", "1.5M".
std::string ShortCount(double count) {
  if (count >= 1e6) return fmt::format("{:.3g}M", count / 1e6);
  if (count >= 1e3) return fmt::format("{:.3g}k", count / 1e3);
  return fmt::format("{:.0f}", count);
}

struct Scale {
  double from_low = 0.0;
  double from_high = 1.0;
  double to_low = 0.0;
  double to_high = 1.0;

  double operator()(double value) const {
    return to_low + (value - from_low) / (from_high - from_low) * (to_high - to_low);
  }
};

bool HasValues(const Panel& panel) {
  return std::ranges::any_of(panel.series, [](const Series& series) {
    return std::ranges::any_of(series.y, [](double y) { return std::isfinite(y); });
  });
}

/// low, low + tick, ... up to `high`.
std::vector<double> Ticks(double low, double high, double tick) {
  const int last = static_cast<int>(std::floor((high - low) / tick + 1e-6));
  std::vector<double> ticks;
  ticks.reserve(static_cast<std::size_t>(last) + 1);
  for (int i = 0; i <= last; ++i) ticks.push_back(low + i * tick);
  return ticks;
}

struct Axis {
  double low = 0.0;
  double high = 1.0;
  double tick = 0.25;
};

/// Round numbers around every known y of a panel.
Axis YAxis(const Panel& panel) {
  if (panel.is_rate) return {};
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const Series& series : panel.series) {
    for (const double y : series.y) {
      if (!std::isfinite(y)) continue;
      low = std::min(low, y);
      high = std::max(high, y);
    }
  }
  // A line that does not move gets room above and below.
  if (high - low < 1e-9 * std::max(1.0, std::abs(high))) {
    const double room = std::max(1.0, 0.1 * std::abs(high));
    low -= room;
    high += room;
  }
  const double tick = RoundUp((high - low) / kNumYTicks);
  return {tick * std::floor(low / tick), tick * std::ceil(high / tick), tick};
}

class Drawing {
 public:
  Drawing(double x_max, double height) : x_{0.0, x_max, kLeft, kLeft + kPlotWidth} {
    svg_ = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} "
        "{1}\" font-family=\"sans-serif\" font-size=\"12\">\n{2}"
        "<rect class=\"paper\" width=\"{0}\" height=\"{1}\"/>\n",
        kWidth, height, kStyle);
  }

  void Text(double x, double y, std::string_view text, std::string_view attributes = "") {
    Add("<text x=\"{:.1f}\" y=\"{:.1f}\"{}{}>{}</text>\n", x, y, attributes.empty() ? "" : " ",
        attributes, Escape(text));
  }

  void AddPanel(const Panel& panel, double top, double x_tick) {
    const Axis axis = YAxis(panel);
    const Scale y{axis.low, axis.high, top + kPanelHeight, top};
    Text(kLeft, top - 9.0, panel.title, "font-weight=\"bold\"");
    for (const double value : Ticks(axis.low, axis.high, axis.tick)) {
      Add("<line class=\"grid\" x1=\"{}\" y1=\"{y:.1f}\" x2=\"{}\" y2=\"{y:.1f}\"/>", kLeft,
          kLeft + kPlotWidth, fmt::arg("y", y(value)));
      const double shown = std::abs(value) < 1e-6 * axis.tick ? 0.0 : value;
      Text(kLeft - 6.0, y(value) + 4.0,
           panel.is_rate ? fmt::format("{:.0f} %", 100.0 * value) : fmt::format("{:.6g}", shown),
           "class=\"faint\" text-anchor=\"end\"");
    }
    for (const double x : Ticks(0.0, x_.from_high, x_tick)) {
      Add("<line class=\"grid\" x1=\"{x:.1f}\" y1=\"{}\" x2=\"{x:.1f}\" y2=\"{}\"/>\n", top,
          top + kPanelHeight, fmt::arg("x", x_(x)));
    }
    double label_y = top + 12.0;
    for (const Series& series : panel.series) {
      AddSeries(series, y, panel.is_rate, label_y);
      label_y += 18.0;
    }
  }

  void BottomScale(double y, double tick, std::string_view label) {
    for (const double x : Ticks(0.0, x_.from_high, tick)) {
      Text(x_(x), y + 16.0, fmt::format("{:g}", x), "class=\"faint\" text-anchor=\"middle\"");
    }
    Text(kLeft + kPlotWidth / 2.0, y + 36.0, label, "class=\"faint\" text-anchor=\"middle\"");
  }

  /// What the second scale reads at the ticks of the first, between its points in proportion.
  void TopScale(const Figure& figure, double y, double tick) {
    const auto& xs = figure.top_x;
    for (const double x : Ticks(0.0, x_.from_high, tick)) {
      const auto after = std::ranges::lower_bound(xs, x);
      if (after == xs.end()) break;
      const auto i = static_cast<std::size_t>(after - xs.begin());
      const double x0 = i == 0 ? 0.0 : xs[i - 1];
      const double value0 = i == 0 ? 0.0 : figure.top_values[i - 1];
      const double share = xs[i] > x0 ? (x - x0) / (xs[i] - x0) : 1.0;
      Text(x_(x), y, ShortCount(value0 + share * (figure.top_values[i] - value0)),
           "class=\"faint\" text-anchor=\"middle\"");
    }
    Text(kLeft + kPlotWidth + 10.0, y, figure.top_label, "class=\"faint\"");
  }

  std::string Finish() && { return std::move(svg_) + "</svg>\n"; }

 private:
  template <class... Args>
  void Add(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(svg_), format, std::forward<Args>(args)...);
  }

  /// The line, its intervals and dots, and at the right its name with the last value.
  void AddSeries(const Series& series, const Scale& y, bool is_rate, double label_y) {
    const std::string_view colour = ClassOf(series.colour);
    std::string points;
    bool pen_down = false;
    double last = std::numeric_limits<double>::quiet_NaN();
    for (std::size_t i = 0; i < series.x.size(); ++i) {
      if (!std::isfinite(series.y[i])) {
        pen_down = false;
        continue;
      }
      last = series.y[i];
      fmt::format_to(std::back_inserter(points), "{}{:.1f} {:.1f}", pen_down ? "L" : "M",
                     x_(series.x[i]), y(last));
      pen_down = true;
      if (series.has_dots) {
        Add("<circle class=\"{}\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.5\"/>", colour, x_(series.x[i]),
            y(last));
      }
      if (!series.low.empty() && std::isfinite(series.low[i]) && std::isfinite(series.high[i])) {
        Add("<line class=\"interval {}\" x1=\"{x:.1f}\" x2=\"{x:.1f}\" y1=\"{:.1f}\" "
            "y2=\"{:.1f}\"/>",
            colour, y(series.low[i]), y(series.high[i]), fmt::arg("x", x_(series.x[i])));
      }
    }
    if (points.empty()) return;
    Add("<path class=\"line {}\" d=\"{}\"/>\n", colour, points);
    Text(kLeft + kPlotWidth + 10.0, label_y,
         is_rate ? fmt::format("{} {:.1f} %", series.name, 100.0 * last)
                 : fmt::format("{} {:.4g}", series.name, last),
         fmt::format("class=\"name {}\"", colour));
  }

  Scale x_;
  std::string svg_;
};

}  // namespace

std::string DrawFigure(const Figure& figure) {
  std::vector<Panel> panels;
  std::ranges::copy_if(figure.panels, std::back_inserter(panels), HasValues);
  double x_max = 0.0;
  for (const Panel& panel : panels) {
    for (const Series& series : panel.series) {
      for (const double x : series.x) {
        if (std::isfinite(x)) x_max = std::max(x_max, x);
      }
    }
  }
  x_max = std::max(x_max, 1e-9);
  const double tick = RoundUp(x_max / kNumXTicks);
  const bool has_top_scale = !figure.top_x.empty() && !panels.empty();
  const double first = kTop + (has_top_scale ? kTopScale : 10.0);
  const double step = kPanelHeight + kPanelTitle;
  const double end = first + step * static_cast<double>(panels.size());
  Drawing drawing(x_max, end + kBottom);
  drawing.Text(kLeft, 24.0, figure.title, "font-size=\"15\"");
  if (panels.empty()) {
    drawing.Text(kLeft, first + 10.0, "No episode has ended yet.", "class=\"faint\"");
    return std::move(drawing).Finish();
  }
  if (has_top_scale) drawing.TopScale(figure, kTop + 18.0, tick);
  for (std::size_t k = 0; k < panels.size(); ++k) {
    drawing.AddPanel(panels[k], first + step * static_cast<double>(k) + kPanelTitle, tick);
  }
  drawing.BottomScale(end, tick, figure.x_label);
  return std::move(drawing).Finish();
}

}  // namespace slalom::plot
