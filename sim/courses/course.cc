#include "sim/courses/course.h"

#include <algorithm>
#include <cmath>

namespace slalom::sim {
namespace {

Bounds Including(Bounds bounds, base::Vec2 p_W, base::Vec2 reach) {
  return {{std::min(bounds.min_W.x, p_W.x - reach.x), std::min(bounds.min_W.y, p_W.y - reach.y)},
          {std::max(bounds.max_W.x, p_W.x + reach.x), std::max(bounds.max_W.y, p_W.y + reach.y)}};
}

}  // namespace

Bounds Including(Bounds bounds, const Circle& circle) {
  return Including(bounds, circle.p_W, {circle.radius, circle.radius});
}

Bounds Including(Bounds bounds, const Box& box) {
  const auto [s, c] = base::SinCos(box.X_WB.yaw);
  return Including(bounds, box.X_WB.p,
                   {std::abs(c) * box.half_size.x + std::abs(s) * box.half_size.y,
                    std::abs(s) * box.half_size.x + std::abs(c) * box.half_size.y});
}

double DistanceTo(const Circle& circle, base::Vec2 p_W) {
  return base::Norm(circle.p_W - p_W) - circle.radius;
}

double DistanceTo(const Box& box, base::Vec2 p_W) {
  const base::Vec2 p_B = base::InverseTransform(box.X_WB, p_W);
  const double x = std::max(0.0, std::abs(p_B.x) - box.half_size.x);
  const double y = std::max(0.0, std::abs(p_B.y) - box.half_size.y);
  return std::sqrt(x * x + y * y);
}

double ReferenceLength(const Course& course) {
  double length = 0.0;
  base::Vec2 last = course.start.p;
  for (const base::Vec2& point : course.reference_path_W) {
    length += base::Norm(point - last);
    last = point;
  }
  return length + base::Norm(course.goal_W - last);
}

}  // namespace slalom::sim
