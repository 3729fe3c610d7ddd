#include "sim/courses/reference_path.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "sim/courses/course_check.h"
#include "sim/courses/course_difficulty.h"
#include "sim/courses/course_path.h"

namespace slalom::sim {
namespace {

constexpr double kRobotRadius = 0.5 * kRobotWidth;
constexpr double kSampleStep = 0.02;  // Between places where a straight line is checked, [m].
constexpr double kMaxCells = 1.2e6;   // Enough for the largest course on cells of 0.15 m.
constexpr int kMaxHalvings = 2;
constexpr int kGoalReach = 2;  // Cells between the goal and the end of the grid's path.

bool IsFree(const Course& course, double radius, base::Vec2 p_W) {
  const auto is_clear = [radius, p_W](const auto& obstacle) {
    return DistanceTo(obstacle, p_W) >= radius;
  };
  return std::ranges::all_of(course.circles, is_clear) &&
         std::ranges::all_of(course.boxes, is_clear);
}

bool IsLineFree(const Course& course, double radius, base::Vec2 from_W, base::Vec2 to_W) {
  const int num_steps = static_cast<int>(std::ceil(base::Norm(to_W - from_W) / kSampleStep));
  for (int i = 1; i <= num_steps; ++i) {
    const double share = static_cast<double>(i) / num_steps;
    if (!IsFree(course, radius, from_W + share * (to_W - from_W))) return false;
  }
  return true;
}

/// The cells of a course whose centres are inside its bounds. Rows run along x, columns along y.
class CourseCells {
 public:
  CourseCells(const Course& course, double radius, double size)
      : course_(course),
        radius_(radius),
        size_(size),
        start_cell_{CellsBetween(course.bounds.min_W.x, course.start.p.x),
                    CellsBetween(course.bounds.min_W.y, course.start.p.y)},
        num_rows_(start_cell_.row + CellsBetween(course.start.p.x, course.bounds.max_W.x) + 1),
        num_cols_(start_cell_.col + CellsBetween(course.start.p.y, course.bounds.max_W.y) + 1) {}

  double num_cells() const { return static_cast<double>(num_rows_) * num_cols_; }

  /// The cells from the start to a cell beside the goal, over cells that are not `blocked`. Nothing
  /// if there is no path.
  std::optional<std::vector<Cell>> FindPath(const PathGrid& blocked) const {
    const auto exit = CellBesideGoal(blocked);
    if (!exit || blocked.blocked(start_cell_)) return std::nullopt;
    return sim::FindPath(blocked, start_cell_, *exit);
  }

  /// The points at which a path turns, without its first, and without the goal.
  std::vector<base::Vec2> CornersOf(const std::vector<Cell>& cells) const {
    std::vector<base::Vec2> corners_W;
    for (std::size_t i = 1; i < cells.size(); ++i) {
      const base::Vec2 here = CentreOf(cells[i]);
      const bool is_last = i + 1 == cells.size();
      const bool turns = is_last || std::abs(base::Cross(here - CentreOf(cells[i - 1]),
                                                         CentreOf(cells[i + 1]) - here)) > 1e-9;
      if (turns && !(is_last && here == course_.goal_W)) corners_W.push_back(here);
    }
    return corners_W;
  }

  PathGrid BlockedCells() const {
    PathGrid grid(num_rows_, num_cols_);
    for (const Circle& circle : course_.circles) {
      Block(circle, Including({circle.p_W, circle.p_W}, circle), grid);
    }
    for (const Box& box : course_.boxes) Block(box, Including({box.X_WB.p, box.X_WB.p}, box), grid);
    return grid;
  }

 private:
  int CellsBetween(double low, double high) const { return static_cast<int>((high - low) / size_); }

  base::Vec2 CentreOf(Cell cell) const {
    return course_.start.p + size_ * base::Vec2{double(cell.row - start_cell_.row),
                                                double(cell.col - start_cell_.col)};
  }

  Cell CellNear(base::Vec2 p_W) const {
    const base::Vec2 cells = 1.0 / size_ * (p_W - course_.start.p);
    return {start_cell_.row + static_cast<int>(std::lround(cells.x)),
            start_cell_.col + static_cast<int>(std::lround(cells.y))};
  }

  /// Blocks the cells nearer to the obstacle than the radius.
  template <class Obstacle>
  void Block(const Obstacle& obstacle, const Bounds& extent, PathGrid& grid) const {
    const base::Vec2 reach{radius_, radius_};
    const Cell low = CellNear(extent.min_W - reach);
    const Cell high = CellNear(extent.max_W + reach);
    for (int row = std::max(0, low.row); row <= std::min(num_rows_ - 1, high.row); ++row) {
      for (int col = std::max(0, low.col); col <= std::min(num_cols_ - 1, high.col); ++col) {
        if (DistanceTo(obstacle, CentreOf({row, col})) < radius_) grid.Block({row, col});
      }
    }
  }

  /// The free cell nearest to the goal from which a straight line leads there.
  std::optional<Cell> CellBesideGoal(const PathGrid& blocked) const {
    const base::Vec2 goal_W = course_.goal_W;
    const Cell near = CellNear(goal_W);
    std::optional<Cell> best;
    for (int row = near.row - kGoalReach; row <= near.row + kGoalReach; ++row) {
      for (int col = near.col - kGoalReach; col <= near.col + kGoalReach; ++col) {
        const Cell cell{row, col};
        if (!blocked.Holds(cell) || blocked.blocked(cell)) continue;
        const base::Vec2 p_W = CentreOf(cell);
        const bool is_nearer =
            !best || base::Norm(goal_W - p_W) < base::Norm(goal_W - CentreOf(*best));
        if (is_nearer && IsLineFree(course_, radius_, p_W, goal_W)) best = cell;
      }
    }
    return best;
  }

  const Course& course_;
  const double radius_;  // [m]
  const double size_;    // [m]
  const Cell start_cell_;
  const int num_rows_;
  const int num_cols_;
};

}  // namespace

std::vector<base::Vec2> FindReferencePath(const Course& course) {
  if (IsLineFree(course, kRobotRadius, course.start.p, course.goal_W)) return {};
  double size = kCellSize;
  for (int halvings = 0; halvings <= kMaxHalvings; ++halvings, size *= 0.5) {
    const CourseCells cells(course, kRobotRadius, size);
    if (cells.num_cells() > kMaxCells) break;
    if (const auto path = cells.FindPath(cells.BlockedCells())) return cells.CornersOf(*path);
  }
  return {};
}

bool AddReferencePath(Course& course, double clearance) {
  const CourseCells cells(course, clearance, kCellSize);
  const PathGrid blocked = cells.BlockedCells();
  const auto path = cells.FindPath(blocked);
  if (!path || path->size() < 2) return false;
  course.difficulty = MeasureDifficulty(blocked, *path);
  if (!IsLineFree(course, clearance, course.start.p, course.goal_W)) {
    course.reference_path_W = cells.CornersOf(*path);
  }
  return true;
}

}  // namespace slalom::sim
