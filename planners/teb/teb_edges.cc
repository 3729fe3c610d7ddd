#include "planners/teb/teb_edges.h"

#include <cmath>

namespace slalom::planners {
namespace {

/// How fast the sign of a motion changes around standstill, [1/m].
constexpr double kSignSteepness = 100.0;

// Indices of the unknowns of a pair.
constexpr int kAx = 0, kAy = 1, kAyaw = 2, kDt = 3, kBx = 4, kBy = 5, kByaw = 6;

struct Way {
  base::Vec2 d;
  double length;
  base::Vec2 direction;  // Zero if there is no way.
};

Way WayBetween(const base::Pose2& a, const base::Pose2& b) {
  const base::Vec2 d = b.p - a.p;
  const double length = base::Norm(d);
  return {d, length, length > 0.0 ? (1.0 / length) * d : base::Vec2{}};
}

}  // namespace

Penalty PenalizeOutside(double value, double low, double high, double margin) {
  if (value < low + margin) return {low + margin - value, -1.0};
  if (value > high - margin) return {value - (high - margin), 1.0};
  return {};
}

Penalty PenalizeBelow(double value, double low, double margin) {
  if (value < low + margin) return {low + margin - value, -1.0};
  return {};
}

PairMotion MotionBetween(const base::Pose2& a, double dt, const base::Pose2& b) {
  PairMotion motion;
  const Way way = WayBetween(a, b);
  const auto [s, c] = base::SinCos(a.yaw);
  const double forward = kSignSteepness * (c * way.d.x + s * way.d.y);
  const double scale = 1.0 / (1.0 + std::abs(forward));
  const double sign = forward * scale;
  const double sign_slope = kSignSteepness * scale * scale;
  Dual<kPairSize>& v = motion.linear;
  v.value = way.length * sign / dt;
  const double by_dx = (way.direction.x * sign + way.length * sign_slope * c) / dt;
  const double by_dy = (way.direction.y * sign + way.length * sign_slope * s) / dt;
  v.gradient[kAx] = -by_dx;
  v.gradient[kAy] = -by_dy;
  v.gradient[kAyaw] = way.length * sign_slope * (c * way.d.y - s * way.d.x) / dt;
  v.gradient[kDt] = -v.value / dt;
  v.gradient[kBx] = by_dx;
  v.gradient[kBy] = by_dy;
  Dual<kPairSize>& w = motion.angular;
  w.value = base::WrapAngle(b.yaw - a.yaw) / dt;
  w.gradient[kAyaw] = -1.0 / dt;
  w.gradient[kDt] = -w.value / dt;
  w.gradient[kByaw] = 1.0 / dt;
  return motion;
}

Dual<kTripleSize> AccelerationBetween(const Dual<kPairSize>& earlier, double earlier_dt,
                                      const Dual<kPairSize>& later, double later_dt) {
  Dual<kTripleSize> acceleration;
  const double time = 0.5 * (earlier_dt + later_dt);
  acceleration.value = (later.value - earlier.value) / time;
  acceleration.gradient.head<kPairSize>() -= earlier.gradient / time;
  acceleration.gradient.tail<kPairSize>() += later.gradient / time;
  acceleration.gradient[kDt] -= 0.5 * acceleration.value / time;
  acceleration.gradient[kDt + 4] -= 0.5 * acceleration.value / time;
  return acceleration;
}

Dual<kPairSize> AccelerationAtEnd(const Dual<kPairSize>& motion, double dt, double end_speed,
                                  bool is_start) {
  const double sign = is_start ? 1.0 : -1.0;
  Dual<kPairSize> acceleration;
  acceleration.value = sign * (motion.value - end_speed) / dt;
  acceleration.gradient = sign * motion.gradient / dt;
  acceleration.gradient[kDt] -= acceleration.value / dt;
  return acceleration;
}

Dual<kPairSize> NonholonomicError(const base::Pose2& a, const base::Pose2& b) {
  const auto [sin_a, cos_a] = base::SinCos(a.yaw);
  const auto [sin_b, cos_b] = base::SinCos(b.yaw);
  const base::Vec2 d = b.p - a.p;
  Dual<kPairSize> error;
  error.value = (cos_a + cos_b) * d.y - (sin_a + sin_b) * d.x;
  error.gradient[kAx] = sin_a + sin_b;
  error.gradient[kAy] = -(cos_a + cos_b);
  error.gradient[kAyaw] = -sin_a * d.y - cos_a * d.x;
  error.gradient[kBx] = -(sin_a + sin_b);
  error.gradient[kBy] = cos_a + cos_b;
  error.gradient[kByaw] = -sin_b * d.y - cos_b * d.x;
  return error;
}

Dual<kPairSize> ForwardWay(const base::Pose2& a, const base::Pose2& b) {
  const auto [s, c] = base::SinCos(a.yaw);
  const base::Vec2 d = b.p - a.p;
  Dual<kPairSize> way;
  way.value = c * d.x + s * d.y;
  way.gradient[kAx] = -c;
  way.gradient[kAy] = -s;
  way.gradient[kAyaw] = c * d.y - s * d.x;
  way.gradient[kBx] = c;
  way.gradient[kBy] = s;
  return way;
}

Dual<kPairSize> DistanceBetween(const base::Pose2& a, const base::Pose2& b) {
  const Way way = WayBetween(a, b);
  Dual<kPairSize> distance;
  distance.value = way.length;
  distance.gradient[kAx] = -way.direction.x;
  distance.gradient[kAy] = -way.direction.y;
  distance.gradient[kBx] = way.direction.x;
  distance.gradient[kBy] = way.direction.y;
  return distance;
}

Dual<3> DistanceToPoint(const base::Pose2& pose, base::Vec2 p) {
  const Way way = WayBetween({p, 0.0}, pose);
  return {way.length, {way.direction.x, way.direction.y, 0.0}};
}

}  // namespace slalom::planners
