#include "sim/courses/clutter.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace slalom::sim {

Box WallBetween(base::Vec2 from_W, base::Vec2 to_W) {
  constexpr double kHalf = 0.5 * kThinWall;
  const base::Vec2 reach = 0.5 * (to_W - from_W);
  return {{0.5 * (from_W + to_W), 0.0}, {std::abs(reach.x) + kHalf, std::abs(reach.y) + kHalf}};
}

void Enclose(const Bounds& inside, Course& course) {
  const auto& [low, high] = inside;
  constexpr base::Vec2 kReach{kThinWall, kThinWall};
  course.bounds = {low - kReach, high + kReach};
  course.boxes.push_back(WallBetween(low, {high.x, low.y}));
  course.boxes.push_back(WallBetween({low.x, high.y}, high));
  course.boxes.push_back(WallBetween(low, {low.x, high.y}));
  course.boxes.push_back(WallBetween({high.x, low.y}, high));
}

Piece LegsAt(const base::Pose2& X_WB, base::Vec2 half_size, double radius) {
  Piece piece;
  for (const base::Vec2 side : {base::Vec2{1, 1}, {-1, 1}, {-1, -1}, {1, -1}}) {
    const base::Vec2 p_W = base::Transform(X_WB, {side.x * half_size.x, side.y * half_size.y});
    piece.circles.push_back({p_W, radius});
  }
  return piece;
}

double DistanceTo(const Piece& piece, base::Vec2 p_W) {
  double distance = std::numeric_limits<double>::infinity();
  for (const Circle& circle : piece.circles) distance = std::min(distance, DistanceTo(circle, p_W));
  for (const Box& box : piece.boxes) distance = std::min(distance, DistanceTo(box, p_W));
  return distance;
}

double DistanceToEnds(const Piece& piece, const Course& course) {
  return std::min(DistanceTo(piece, course.start.p), DistanceTo(piece, course.goal_W));
}

void Add(const Piece& piece, Course& course) {
  course.circles.insert(course.circles.end(), piece.circles.begin(), piece.circles.end());
  course.boxes.insert(course.boxes.end(), piece.boxes.begin(), piece.boxes.end());
}

base::Pose2 DrawPose(const Bounds& inside, double margin, base::Random& random) {
  const double x = random.Uniform(inside.min_W.x + margin, inside.max_W.x - margin);
  const double y = random.Uniform(inside.min_W.y + margin, inside.max_W.y - margin);
  return {{x, y}, random.Uniform(-base::kPi, base::kPi)};
}

}  // namespace slalom::sim
