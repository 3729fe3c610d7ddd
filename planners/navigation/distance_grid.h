#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "planners/navigation/costmap.h"

namespace slalom::planners {

/// For each cell of a costmap, the number of steps to the nearest target cell. Steps lead along
/// free cells in four directions, as in base_local_planner's MapGrid. A wave spreads from the
/// targets, and only as far as distances are asked for. Confined to one thread at a time; allocates
/// when the map's size changes.
class DistanceGrid {
 public:
  /// The distance of a cell from which no target can be reached.
  static constexpr std::uint16_t kNoWay = 0xffff;

  /// Starts a wave at the targets. Cells of kInscribedCost and above are impassable, except those
  /// `under_robot` and the targets themselves. Requires: all of them are on the map.
  /// Cost: O(cells), about 10 us for 200 x 200.
  void Start(const Costmap& costmap, std::span<const CellIndex> under_robot,
             std::span<const CellIndex> targets);

  /// Returns the distance of a cell, in steps. Requires: c is on the map.
  /// Cost: O(cells that the wave has still to reach before c), a few ns each.
  std::uint16_t Distance(CellIndex c) {
    const int n = Index(c);
    if (distances_[static_cast<std::size_t>(n)] == kNotReached) SpreadTo(n);
    const std::uint16_t distance = distances_[static_cast<std::size_t>(n)];
    return distance == kNotReached ? kNoWay : distance;
  }

 private:
  static constexpr std::uint16_t kNotReached = 0xfffe;

  int Index(CellIndex c) const { return (c.y + 1) * stride_ + c.x + 1; }
  void SpreadTo(int n);

  int stride_ = 0;
  std::vector<std::uint16_t> distances_;  // [size_y + 2, size_x + 2], with a border of walls.
  std::vector<int> wave_;                 // Cells in the order in which they are reached.
  int wave_begin_ = 0, wave_end_ = 0;     // The part of it whose neighbours are not reached yet.
};

}  // namespace slalom::planners
