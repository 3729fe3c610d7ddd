#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "planners/navigation/costmap.h"

namespace slalom::planners {

/// For each cell of a costmap, the number of steps to the nearest target cell. Steps lead along
/// free cells in four directions, as in base_local_planner's MapGrid. Confined to one thread at a
/// time; allocates when the map's size changes.
class DistanceGrid {
 public:
  /// The distance of a cell from which no target can be reached.
  static constexpr std::uint16_t kNoWay = 0xffff;

  /// Computes all distances. Cells of kInscribedCost and above are impassable, except those
  /// `under_robot` and the targets themselves. Requires: targets are on the map.
  /// Cost: O(cells), about 0.1 ms for 200 x 200.
  void Compute(const Costmap& costmap, std::span<const CellIndex> under_robot,
               std::span<const CellIndex> targets);

  /// Requires: c is on the map.
  std::uint16_t distance(CellIndex c) const {
    const int cell = (c.y + 1) * stride_ + c.x + 1;
    return distances_[static_cast<std::size_t>(cell)];
  }

 private:
  int stride_ = 0;
  std::vector<std::uint16_t> distances_;  // [size_y + 2, size_x + 2], with a border of walls.
  std::vector<int> wave_;                 // Cells in the order in which they are reached.
};

}  // namespace slalom::planners
