#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "sim/courses/barn_field.h"

namespace slalom::sim {

/// Cells where the robot's centre must not be, in a grid of any size. A value.
class PathGrid {
 public:
  /// All cells are free. Requires: both numbers are above 0.
  PathGrid(int num_rows, int num_cols);
  explicit PathGrid(const FieldGrid& blocked);

  int num_rows() const { return num_rows_; }
  int num_cols() const { return num_cols_; }
  bool Holds(Cell cell) const {
    return cell.row >= 0 && cell.row < num_rows_ && cell.col >= 0 && cell.col < num_cols_;
  }
  /// Both require: Holds(cell).
  bool blocked(Cell cell) const { return blocked_[Index(cell)] != 0; }
  void Block(Cell cell) { blocked_[Index(cell)] = 1; }

 private:
  std::size_t Index(Cell cell) const {
    return static_cast<std::size_t>(cell.row) * static_cast<std::size_t>(num_cols_) +
           static_cast<std::size_t>(cell.col);
  }

  const int num_rows_;
  const int num_cols_;
  std::vector<std::uint8_t> blocked_;  // [num_rows, num_cols]
};

/// Finds the cheapest way from `entry` to `exit`, both included, over cells that are not `blocked`.
/// Returns nothing if there is none.
///
/// A move goes to one of the 8 neighbours, turns by at most 45 degrees and does not pass between
/// two blocked cells that touch at a corner. It costs its length in cells, and 5 / d more if it
/// ends at a distance of d <= 2 cells from a blocked one. The search is exact over (cell, direction
/// of arrival); the published A* keeps one direction per cell.
///
/// Requires: both ends are in the grid and not blocked.
/// Memory: 100 bytes for each cell.
std::optional<std::vector<Cell>> FindPath(const PathGrid& blocked, Cell entry, Cell exit);
std::optional<std::vector<Cell>> FindPath(const FieldGrid& blocked, Cell entry, Cell exit);

}  // namespace slalom::sim
