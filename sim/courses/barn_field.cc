#include "sim/courses/barn_field.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sim/courses/course_difficulty.h"

namespace slalom::sim {
namespace {

constexpr int kRobotRadius = 2;  // Cells that the robot takes up on each side of its centre.

bool IsEnclosed(const FieldGrid& obstacles, Cell cell) {
  for (int row = cell.row - 1; row <= cell.row + 1; ++row) {
    for (int col = cell.col - 1; col <= cell.col + 1; ++col) {
      if (!IsInField({row, col}) || !obstacles.filled({row, col})) return false;
    }
  }
  return true;
}

}  // namespace

FieldGrid InflateByRobot(const FieldGrid& obstacles) {
  std::array<std::uint32_t, kFieldSize> widened{};
  for (int row = 0; row < kFieldSize; ++row) {
    std::uint32_t bits = 0;
    for (int shift = 0; shift <= kRobotRadius; ++shift) {
      bits |= obstacles.row(row) << shift | obstacles.row(row) >> shift;
    }
    widened[static_cast<std::size_t>(row)] = bits;
  }
  FieldGrid blocked;
  for (int row = 0; row < kFieldSize; ++row) {
    std::uint32_t bits = 0;
    const int last = std::min(row + kRobotRadius, kFieldSize - 1);
    for (int r = std::max(row - kRobotRadius, 0); r <= last; ++r) {
      bits |= widened[static_cast<std::size_t>(r)];
    }
    blocked.set_row(row, bits);
  }
  return blocked;
}

base::Vec2 CellCentre(Cell cell) {
  return {(-4425 + 150 * cell.row) / 1000.0, (5175 + 150 * cell.col) / 1000.0};
}

std::optional<Cell> CellAt(base::Vec2 p_W) {
  const double row = std::round((p_W.x + 4.425) / kCellSize);
  const double col = std::round((p_W.y - 5.175) / kCellSize);
  if (!(row >= 0 && row < kFieldSize && col >= -kPenColumns && col < kFieldSize)) {
    return std::nullopt;
  }
  const Cell cell{static_cast<int>(row), static_cast<int>(col)};
  if (base::Norm(CellCentre(cell) - p_W) > 1e-4) return std::nullopt;
  return cell;
}

Course MakeBarnCourse(std::string name, const FieldGrid& obstacles, std::span<const Cell> path) {
  Course course;
  course.name = std::move(name);
  course.start = BarnStart();
  course.goal_W = BarnGoal();
  course.bounds = BarnBounds();
  for (int col = -kPenColumns; col < kFieldSize; ++col) {
    for (int row = 0; row < kFieldSize; ++row) {
      const bool filled = col < 0
                              ? col == -kPenColumns || row == 0 || row == kFieldSize - 1
                              : obstacles.filled({row, col}) && !IsEnclosed(obstacles, {row, col});
      if (filled) course.circles.push_back({CellCentre({row, col}), kCylinderRadius});
    }
  }
  for (const Cell& cell : path) course.reference_path_W.push_back(CellCentre(cell));
  if (path.size() >= 2) course.difficulty = MeasureDifficulty(InflateByRobot(obstacles), path);
  return course;
}

base::Pose2 BarnStart() { return {{-2.0, 3.0}, 1.57}; }
base::Vec2 BarnGoal() { return {-2.0, 13.0}; }
Bounds BarnBounds() { return {{-4.5, 0.0}, {0.0, 13.5}}; }

}  // namespace slalom::sim
