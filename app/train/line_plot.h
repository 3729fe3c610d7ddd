#pragma once

#include <string>
#include <vector>

namespace slalom::plot {

/// A colour with a darker and a lighter shade, for light and dark viewers.
enum class Colour { kGreen, kRed, kAmber, kBlue };

/// One line of a panel.
struct Series {
  std::string name;
  Colour colour = Colour::kBlue;
  std::vector<double> x;
  std::vector<double> y;         ///< Same length as x; NaN leaves a gap.
  std::vector<double> low = {};  ///< Ends of intervals, each as long as x; empty for none.
  std::vector<double> high = {};
  bool has_dots = false;  ///< Draws each point, for few points measured one by one.
};

/// Lines over the figure's x axis.
struct Panel {
  std::string title;
  bool is_rate = false;  ///< y from 0 to 1, shown as percent; else from the least to the largest.
  std::vector<Series> series;
};

/// Panels below each other with one x axis.
struct Figure {
  std::string title;
  std::string x_label;
  std::string top_label;  ///< Label of a second scale above the panels.
  /// Readings of the second scale by x, in the order of x; empty for no second scale.
  std::vector<double> top_x;
  std::vector<double> top_values;
  std::vector<Panel> panels;  ///< Panels without any known y are left out.
};

/// The figure as a self-contained SVG document, which follows the viewer's light or dark scheme.
/// All texts are escaped. Without any panel, the figure holds a sentence about that.
std::string DrawFigure(const Figure& figure);

}  // namespace slalom::plot
