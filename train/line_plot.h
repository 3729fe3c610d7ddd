#pragma once

#include <string>
#include <vector>

namespace slalom::train {

/// One line of a plot.
struct PlotSeries {
  std::string name;
  std::string colour;  ///< As SVG takes it, "#1f77b4".
  std::vector<double> x;
  std::vector<double> y;  ///< Same length as x; NaN leaves a gap.
};

/// A plot of lines over a common x axis, y from 0 to 1 shown as percent, as a self-contained SVG
/// document.
std::string DrawRatePlot(const std::string& title, const std::string& x_label,
                         const std::vector<PlotSeries>& series);

}  // namespace slalom::train
