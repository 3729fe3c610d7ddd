#pragma once

#include <cstdint>
#include <vector>

#include "base/geometry.h"
#include "planners/costmap.h"

namespace slalom::planners {

/// Spreads costs round obstacles, as costmap_2d's inflation layer does: at a distance of d from the
/// nearest lethal cell, centre to centre, kInscribedCost where d <= inscribed radius, then
/// floor(252 exp(-scaling (d - inscribed radius))) up to the inflation radius.
///
/// ROS finds the nearest obstacle by a flood that can miss it by a cell; here it is exact.
/// Immutable.
class Inflation {
 public:
  /// Requires: all > 0, save inscribed_radius and scaling >= 0.
  Inflation(double resolution, double inscribed_radius, double inflation_radius, double scaling);

  /// Cost at a distance of (dx, dy) cells from the only obstacle.
  std::uint8_t CostAt(int dx, int dy) const;
  /// Cells that an obstacle reaches to each side.
  int reach() const { return reach_; }

  /// Writes the costs of the window, which follow from the lethal cells of `obstacles` in the
  /// window and up to `reach()` cells round it. Requires: grids of the same size; the window is
  /// inside. Cost: O(window + lethal cells * reach^2), about 10 us for a local map.
  void Apply(const std::vector<std::uint8_t>& obstacles, const CellWindow& window,
             Costmap& costmap) const;

 private:
  int reach_;
  std::vector<std::uint8_t> stamp_;  // [2 reach + 1, 2 reach + 1]
};

}  // namespace slalom::planners
