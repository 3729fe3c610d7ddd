#pragma once

#include <cstdint>
#include <vector>

#include "base/geometry.h"
#include "planners/navigation/costmap.h"

namespace slalom::planners {

/// Spreads costs around obstacles, as costmap_2d's inflation layer does. For a cell at a distance d
/// from the nearest lethal cell, centre to centre, the cost is kInscribedCost if d <= inscribed
/// radius, else floor(252 exp(-scaling (d - inscribed radius))) up to the inflation radius.
///
/// ROS finds the nearest obstacle by a flood fill that can be wrong by a cell; here it is exact.
/// Immutable.
class Inflation {
 public:
  /// Requires: resolution, inflation_radius > 0; inscribed_radius, scaling >= 0.
  Inflation(double resolution, double inscribed_radius, double inflation_radius, double scaling);

  /// Returns the cost at a distance of (dx, dy) cells from a single obstacle.
  std::uint8_t CostAt(int dx, int dy) const;
  /// Number of cells that the inflation of an obstacle reaches to each side.
  int reach() const { return reach_; }

  /// Writes the costs of the window, which depend on the lethal cells of `obstacles` in the window
  /// and up to `reach()` cells around it. Requires: grids of the same size; the window is inside.
  /// Cost: O(window + lethal cells * reach^2), about 10 us for a local map.
  void Apply(const std::vector<std::uint8_t>& obstacles, const CellWindow& window,
             Costmap& costmap) const;

 private:
  int reach_;
  std::vector<std::uint8_t> stamp_;  // [2 reach + 1, 2 reach + 1]
};

}  // namespace slalom::planners
