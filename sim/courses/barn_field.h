#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "sim/courses/course.h"

/// The lattice that all static BARN courses lie on (docs/original-system.md, section 1.5): a field
/// of 30 x 30 cells of 0.15 m behind a start pen of 34 cells. Rows run across the course (x),
/// columns along it (y, the way of travel); column 0 of the field touches the pen, column 29 opens
/// towards the goal.

namespace slalom::sim {

inline constexpr int kFieldSize = 30;      ///< Rows of the field, and columns.
inline constexpr int kPenColumns = 34;     ///< Columns of the start pen, in front of the field.
inline constexpr double kCellSize = 0.15;  ///< [m]
inline constexpr double kCylinderRadius = 0.075;  ///< [m]

/// A cell of the field. A value.
struct Cell {
  int row = 0;
  int col = 0;

  friend constexpr bool operator==(const Cell&, const Cell&) = default;
};

constexpr bool IsInField(Cell cell) {
  return cell.row >= 0 && cell.row < kFieldSize && cell.col >= 0 && cell.col < kFieldSize;
}

/// A set of cells of the field: the obstacles, or the cells where the robot's centre must not be. A
/// value.
class FieldGrid {
 public:
  /// Requires: IsInField(cell).
  bool filled(Cell cell) const { return (rows_[Index(cell.row)] >> cell.col & 1u) != 0; }
  void set_filled(Cell cell, bool filled) {
    const std::uint32_t bit = 1u << cell.col;
    rows_[Index(cell.row)] = filled ? rows_[Index(cell.row)] | bit : rows_[Index(cell.row)] & ~bit;
  }

  /// A whole row: bit c is column c. Bits from kFieldSize on are 0.
  std::uint32_t row(int row) const { return rows_[Index(row)]; }
  void set_row(int row, std::uint32_t bits) { rows_[Index(row)] = bits & kFullRow; }

  static constexpr std::uint32_t kFullRow = (1u << kFieldSize) - 1;

  friend bool operator==(const FieldGrid&, const FieldGrid&) = default;

 private:
  static constexpr std::size_t Index(int row) { return static_cast<std::size_t>(row); }

  std::array<std::uint32_t, kFieldSize> rows_{};
};

/// The cells where the robot's centre must not be: the cells with an obstacle among the 5 x 5 cells
/// round them. Cells beyond the field count as free.
FieldGrid InflateByRobot(const FieldGrid& obstacles);

/// The centre of a cell. Its coordinates are rounded to the doubles nearest to the decimals in the
/// world files. Columns below 0 belong to the pen: -1 is its last column, -kPenColumns its first.
base::Vec2 CellCentre(Cell cell);

/// The cell of the field or pen whose centre is within 1e-4 m of `p_W`, or nothing if `p_W` is off
/// the lattice.
std::optional<Cell> CellAt(base::Vec2 p_W);

/// Makes the static course with these obstacles: pen, field, start, goal, and difficulty along the
/// path. Cells whose 8 neighbours are all filled are left out, as in the world files, because they
/// can be neither seen nor hit.
Course MakeBarnCourse(std::string name, const FieldGrid& obstacles, std::span<const Cell> path);

/// Start, goal and bounds, which all static courses share.
base::Pose2 BarnStart();
base::Vec2 BarnGoal();
Bounds BarnBounds();

}  // namespace slalom::sim
