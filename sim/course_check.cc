#include "sim/course_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace slalom::sim {
namespace {

constexpr double kGridCell = 0.025;      // [m]
constexpr double kMaxGridCells = 4.0e7;  // 158 m x 158 m.
constexpr double kDiscRadius = 0.5 * kRobotWidth;

/// Distance from `p_W` to the box, 0 inside.
double DistanceTo(const Box& box, base::Vec2 p_W) {
  const base::Vec2 p_B = base::InverseTransform(box.X_WB, p_W);
  const double x = std::max(0.0, std::abs(p_B.x) - box.half_size.x);
  const double y = std::max(0.0, std::abs(p_B.y) - box.half_size.y);
  return std::sqrt(x * x + y * y);
}

double Clearance(const Course& course, base::Vec2 p_W) {
  double clearance = 1e9;
  for (const Circle& c : course.circles) {
    clearance = std::min(clearance, base::Norm(c.p_W - p_W) - c.radius);
  }
  for (const Box& box : course.boxes) clearance = std::min(clearance, DistanceTo(box, p_W));
  return clearance;
}

/// Whether the projections of two boxes on the axes of `a` keep them apart.
bool AxesSeparate(const Box& a, const Box& b) {
  double min_x = 1e9, max_x = -1e9, min_y = 1e9, max_y = -1e9;
  for (const double sx : {-1.0, 1.0}) {
    for (const double sy : {-1.0, 1.0}) {
      const base::Vec2 corner_W = base::Transform(b.X_WB, {sx * b.half_size.x, sy * b.half_size.y});
      const base::Vec2 corner = base::InverseTransform(a.X_WB, corner_W);
      min_x = std::min(min_x, corner.x);
      max_x = std::max(max_x, corner.x);
      min_y = std::min(min_y, corner.y);
      max_y = std::max(max_y, corner.y);
    }
  }
  return min_x > a.half_size.x || max_x < -a.half_size.x || min_y > a.half_size.y ||
         max_y < -a.half_size.y;
}

bool OutlineCollides(const Course& course, const base::Pose2& X_WR) {
  const Box outline{X_WR, {0.5 * kRobotLength, 0.5 * kRobotWidth}};
  return std::any_of(course.circles.begin(), course.circles.end(),
                     [&](const Circle& c) { return DistanceTo(outline, c.p_W) <= c.radius; }) ||
         std::any_of(course.boxes.begin(), course.boxes.end(), [&](const Box& box) {
           return !AxesSeparate(outline, box) && !AxesSeparate(box, outline);
         });
}

/// Where the centre of a disc of the robot's width may be.
class ClearanceGrid {
 public:
  explicit ClearanceGrid(const Course& course)
      : origin_W_(course.bounds.min_W),
        num_x_(NumCells(course.bounds.max_W.x - course.bounds.min_W.x)),
        num_y_(NumCells(course.bounds.max_W.y - course.bounds.min_W.y)),
        blocked_(static_cast<std::size_t>(num_x_) * static_cast<std::size_t>(num_y_), 0) {
    for (const Circle& c : course.circles) {
      Block(c.p_W, c.radius, [&](base::Vec2 p_W) { return base::Norm(c.p_W - p_W) - c.radius; });
    }
    for (const Box& box : course.boxes) {
      Block(box.X_WB.p, base::Norm(box.half_size),
            [&](base::Vec2 p_W) { return DistanceTo(box, p_W); });
    }
  }

  /// Whether 4-connected free cells lead from the cell of one point to the cell of the other.
  bool Connects(base::Vec2 from_W, base::Vec2 to_W) {
    const std::size_t target = CellOf(to_W);
    std::vector<std::size_t> open = {CellOf(from_W)};
    blocked_[open.front()] = 1;
    const auto n = static_cast<std::size_t>(num_x_);
    while (!open.empty()) {
      const std::size_t cell = open.back();
      open.pop_back();
      if (cell == target) return true;
      const std::size_t x = cell % n;
      if (x > 0) Visit(cell - 1, open);
      if (x + 1 < n) Visit(cell + 1, open);
      if (cell >= n) Visit(cell - n, open);
      if (cell + n < blocked_.size()) Visit(cell + n, open);
    }
    return false;
  }

  static double NumCellsFor(const Bounds& bounds) {
    return (bounds.max_W.x - bounds.min_W.x) / kGridCell *
           ((bounds.max_W.y - bounds.min_W.y) / kGridCell);
  }

 private:
  static int NumCells(double extent) {
    return std::max(1, static_cast<int>(extent / kGridCell) + 1);
  }

  int IndexX(double x) const {
    return std::clamp(static_cast<int>((x - origin_W_.x) / kGridCell), 0, num_x_ - 1);
  }
  int IndexY(double y) const {
    return std::clamp(static_cast<int>((y - origin_W_.y) / kGridCell), 0, num_y_ - 1);
  }
  std::size_t CellOf(base::Vec2 p_W) const {
    return static_cast<std::size_t>(IndexY(p_W.y)) * static_cast<std::size_t>(num_x_) +
           static_cast<std::size_t>(IndexX(p_W.x));
  }

  template <class DistanceFunction>
  void Block(base::Vec2 centre_W, double radius, const DistanceFunction& distance) {
    const double reach = radius + kDiscRadius;
    if (centre_W.x + reach < origin_W_.x || centre_W.y + reach < origin_W_.y ||
        centre_W.x - reach > origin_W_.x + num_x_ * kGridCell ||
        centre_W.y - reach > origin_W_.y + num_y_ * kGridCell) {
      return;
    }
    for (int y = IndexY(centre_W.y - reach); y <= IndexY(centre_W.y + reach); ++y) {
      for (int x = IndexX(centre_W.x - reach); x <= IndexX(centre_W.x + reach); ++x) {
        const base::Vec2 p_W = {origin_W_.x + (x + 0.5) * kGridCell,
                                origin_W_.y + (y + 0.5) * kGridCell};
        if (distance(p_W) < kDiscRadius) {
          blocked_[static_cast<std::size_t>(y) * static_cast<std::size_t>(num_x_) +
                   static_cast<std::size_t>(x)] = 1;
        }
      }
    }
  }

  void Visit(std::size_t cell, std::vector<std::size_t>& open) {
    if (blocked_[cell]) return;
    blocked_[cell] = 1;
    open.push_back(cell);
  }

  const base::Vec2 origin_W_;
  const int num_x_;
  const int num_y_;
  std::vector<std::uint8_t> blocked_;  // [num_y, num_x]
};

bool IsInside(const Bounds& bounds, base::Vec2 p_W) {
  return p_W.x >= bounds.min_W.x && p_W.x <= bounds.max_W.x && p_W.y >= bounds.min_W.y &&
         p_W.y <= bounds.max_W.y;
}

}  // namespace

std::optional<std::string> WhyUnsolvable(const Course& course) {
  const base::Vec2 start = course.start.p;
  const base::Vec2 goal = course.goal_W;
  if (!IsInside(course.bounds, start)) {
    return fmt::format("the start ({}, {}) is outside the bounds", start.x, start.y);
  }
  if (!IsInside(course.bounds, goal)) {
    return fmt::format("the goal ({}, {}) is outside the bounds", goal.x, goal.y);
  }
  if (ClearanceGrid::NumCellsFor(course.bounds) > kMaxGridCells) {
    return fmt::format("its bounds cover more than {:.0f} m^2",
                       kMaxGridCells * kGridCell * kGridCell);
  }
  if (OutlineCollides(course, course.start)) {
    return fmt::format("at the start ({}, {}) the robot stands in an obstacle", start.x, start.y);
  }
  if (Clearance(course, goal) < kDiscRadius) {
    return fmt::format("at the goal ({}, {}) the robot would stand in an obstacle", goal.x, goal.y);
  }
  if (!ClearanceGrid(course).Connects(start, goal)) {
    return fmt::format("no corridor as wide as the robot ({} m) leads from start to goal",
                       kRobotWidth);
  }
  return std::nullopt;
}

}  // namespace slalom::sim
