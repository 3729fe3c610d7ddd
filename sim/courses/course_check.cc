#include "sim/courses/course_check.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <vector>

#include "sim/courses/motion.h"

namespace slalom::sim {
namespace {

constexpr double kGridCell = 0.025;      // [m]
constexpr double kMaxGridCells = 4.0e7;  // 158 m x 158 m.
constexpr double kDiscRadius = 0.5 * kRobotWidth;

double Clearance(const Course& course, base::Vec2 p_W) {
  double clearance = 1e9;
  for (const Circle& c : course.circles) clearance = std::min(clearance, DistanceTo(c, p_W));
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

bool BoxesTouch(const Box& a, const Box& b) { return !AxesSeparate(a, b) && !AxesSeparate(b, a); }

Box OutlineAt(const base::Pose2& X_WR) { return {X_WR, {0.5 * kRobotLength, 0.5 * kRobotWidth}}; }

bool OutlineCollides(const Course& course, const base::Pose2& X_WR) {
  const Box outline = OutlineAt(X_WR);
  return std::any_of(course.circles.begin(), course.circles.end(),
                     [&](const Circle& c) { return DistanceTo(outline, c.p_W) <= c.radius; }) ||
         std::any_of(course.boxes.begin(), course.boxes.end(),
                     [&](const Box& box) { return BoxesTouch(outline, box); });
}

/// Whether the obstacle ever touches the outline on its way. Checks a position every 0.02 m, at
/// most 3.6e5 in all.
bool EverTouches(const MovingObstacle& obstacle, const Motion& motion, const Box& outline) {
  constexpr double kStep = 0.02;  // [m]
  constexpr double kMaxSteps = 3.6e5;
  const double duration = obstacle.key_frames.back().time;
  const double reach = obstacle.radius > 0.0 ? 0.0 : base::Norm(obstacle.half_size);
  const double way = duration * (motion.max_speed() + motion.max_yaw_rate() * reach);
  const int num_steps = static_cast<int>(std::clamp(way / kStep, 1.0, kMaxSteps)) + 1;
  for (int i = 0; i < num_steps; ++i) {
    const base::Pose2 X_WB = motion.At(duration * i / num_steps).X_WB;
    const bool touches = obstacle.radius > 0.0 ? DistanceTo(outline, X_WB.p) <= obstacle.radius
                                               : BoxesTouch(outline, {X_WB, obstacle.half_size});
    if (touches) return true;
  }
  return false;
}

/// A grid of the cells where the centre of a disc of the robot's width may be.
class ClearanceGrid {
 public:
  explicit ClearanceGrid(const Course& course)
      : origin_W_(course.bounds.min_W),
        num_x_(NumCells(course.bounds.max_W.x - course.bounds.min_W.x)),
        num_y_(NumCells(course.bounds.max_W.y - course.bounds.min_W.y)),
        blocked_(static_cast<std::size_t>(num_x_) * static_cast<std::size_t>(num_y_), 0) {
    for (const Circle& c : course.circles) {
      Block(Including({c.p_W, c.p_W}, c), [&](base::Vec2 p_W) { return DistanceTo(c, p_W); });
    }
    for (const Box& box : course.boxes) {
      Block(Including({box.X_WB.p, box.X_WB.p}, box),
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

  /// Blocks the cells nearer than the disc's radius to an obstacle within `extent`.
  template <class DistanceFunction>
  void Block(const Bounds& extent, const DistanceFunction& distance) {
    const base::Vec2 reach = {kDiscRadius, kDiscRadius};
    const base::Vec2 low = extent.min_W - reach;
    const base::Vec2 high = extent.max_W + reach;
    if (high.x < origin_W_.x || high.y < origin_W_.y || low.x > origin_W_.x + num_x_ * kGridCell ||
        low.y > origin_W_.y + num_y_ * kGridCell) {
      return;
    }
    for (int y = IndexY(low.y); y <= IndexY(high.y); ++y) {
      for (int x = IndexX(low.x); x <= IndexX(high.x); ++x) {
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

bool AreFinite(std::initializer_list<double> numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](double v) { return std::isfinite(v); });
}

/// Why the data of `course` are not valid: numbers that are not finite, sizes that are not
/// positive.
std::optional<std::string> WhyMalformed(const Course& course) {
  const auto is_pose = [](const base::Pose2& X) { return AreFinite({X.p.x, X.p.y, X.yaw}); };
  const auto is_size = [](double size) { return size > 0.0 && std::isfinite(size); };
  const Bounds& bounds = course.bounds;
  if (!is_pose(course.start)) return "its start holds something that is not a number";
  if (!AreFinite({course.goal_W.x, course.goal_W.y})) return "its goal is not a number";
  if (!AreFinite({bounds.min_W.x, bounds.min_W.y, bounds.max_W.x, bounds.max_W.y})) {
    return "its bounds hold something that is not a number";
  }
  for (std::size_t i = 0; i < course.circles.size(); ++i) {
    const Circle& circle = course.circles[i];
    if (!AreFinite({circle.p_W.x, circle.p_W.y}) || !is_size(circle.radius)) {
      return fmt::format("its cylinder {} is not valid: centre ({}, {}), radius {}", i,
                         circle.p_W.x, circle.p_W.y, circle.radius);
    }
  }
  for (std::size_t i = 0; i < course.boxes.size(); ++i) {
    const Box& box = course.boxes[i];
    if (!is_pose(box.X_WB) || !is_size(box.half_size.x) || !is_size(box.half_size.y)) {
      return fmt::format("its box {} is not valid: centre ({}, {}), yaw {}, half sizes {} and {}",
                         i, box.X_WB.p.x, box.X_WB.p.y, box.X_WB.yaw, box.half_size.x,
                         box.half_size.y);
    }
  }
  for (std::size_t i = 0; i < course.moving.size(); ++i) {
    const MovingObstacle& obstacle = course.moving[i];
    const bool is_box = is_size(obstacle.half_size.x) && is_size(obstacle.half_size.y);
    if (obstacle.radius != 0.0 ? !is_size(obstacle.radius) : !is_box) {
      return fmt::format("its moving obstacle {} has no size: radius {}, half sizes {} and {}", i,
                         obstacle.radius, obstacle.half_size.x, obstacle.half_size.y);
    }
    if (obstacle.key_frames.size() < 2) {
      return fmt::format("its moving obstacle {} has {} key frames, expected 2 or more", i,
                         obstacle.key_frames.size());
    }
    for (std::size_t k = 0; k < obstacle.key_frames.size(); ++k) {
      if (const auto why = WhyBadKeyFrame(obstacle, k)) {
        return fmt::format("its moving obstacle {}: {}", i, *why);
      }
    }
  }
  return std::nullopt;
}

bool IsInside(const Bounds& bounds, base::Vec2 p_W) {
  return p_W.x >= bounds.min_W.x && p_W.x <= bounds.max_W.x && p_W.y >= bounds.min_W.y &&
         p_W.y <= bounds.max_W.y;
}

}  // namespace

std::optional<std::string> WhyBadKeyFrame(const MovingObstacle& obstacle, std::size_t i) {
  const KeyFrame& frame = obstacle.key_frames.at(i);
  const base::Pose2& X_WB = frame.X_WB;
  if (!AreFinite({frame.time, X_WB.p.x, X_WB.p.y, X_WB.yaw})) {
    return fmt::format("key frame {} holds something that is not a number", i);
  }
  if (i == 0) {
    if (frame.time == 0.0) return std::nullopt;
    return fmt::format("the first key frame is at {} s, expected 0", frame.time);
  }
  const KeyFrame& last = obstacle.key_frames[i - 1];
  const double duration = frame.time - last.time;
  if (!(duration > 0.0)) {
    return fmt::format("key frame {} is at {} s, which is not after the one before it, at {} s", i,
                       frame.time, last.time);
  }
  const double way = std::max(base::Norm(X_WB.p - last.X_WB.p),
                              std::abs(base::WrapAngle(X_WB.yaw - last.X_WB.yaw)));
  if (way > kMaxObstacleSpeed * duration) {
    return fmt::format("key frame {} is reached at {:g} m/s or rad/s, expected at most {}", i,
                       way / duration, kMaxObstacleSpeed);
  }
  return std::nullopt;
}

std::optional<std::string> WhyUnsolvable(const Course& course) {
  if (auto reason = WhyMalformed(course)) return reason;
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

std::vector<std::string> CourseWarnings(const Course& course) {
  const Box start = OutlineAt(course.start);
  std::vector<std::size_t> over_start, still;
  for (std::size_t i = 0; i < course.moving.size(); ++i) {
    const Motion motion(course.moving[i]);
    if (motion.max_speed() == 0.0 && motion.max_yaw_rate() == 0.0) still.push_back(i);
    if (EverTouches(course.moving[i], motion, start)) over_start.push_back(i);
  }
  std::vector<std::string> warnings;
  if (!over_start.empty()) {
    warnings.push_back(fmt::format(
        "{} of {} moving obstacles drive over a robot that waits at the start: number {}",
        over_start.size(), course.moving.size(), fmt::join(over_start, ", ")));
  }
  if (!still.empty()) {
    warnings.push_back(
        fmt::format("{} of {} moving obstacles stand still; the check for a way from start to goal "
                    "ignores them: number {}",
                    still.size(), course.moving.size(), fmt::join(still, ", ")));
  }
  return warnings;
}

}  // namespace slalom::sim
