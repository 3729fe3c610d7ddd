#pragma once

#include <array>

#include "base/geometry.h"

/// The terms of TEB's least-squares problem, each with its derivatives, as in teb_local_planner's
/// g2o edges. An edge's error enters the cost as weight * error^2.
///
/// Variables: a band's unknowns stand in one row, four per pose: x, y, yaw, time to the next pose
/// [m, m, rad, s]. An edge sees a run of them that begins with a pose.

namespace slalom::planners {

/// A number and its derivatives by the N unknowns it depends on.
template <int N>
struct Dual {
  double value = 0.0;
  std::array<double, N> gradient{};
};

/// Unknowns of two poses and the time between them, and of three poses and two times.
inline constexpr int kPairSize = 7;
inline constexpr int kTripleSize = 11;

/// How far `value` is outside of [low + margin, high - margin]; 0 inside. With sign +-1 of its
/// slope.
struct Penalty {
  double value = 0.0;
  double slope = 0.0;
};
Penalty PenalizeOutside(double value, double low, double high, double margin);
Penalty PenalizeBelow(double value, double low, double margin);

/// Speed and turn rate from pose a to pose b in the time dt. The distance is the straight one; its
/// sign that of driving forwards in a, made smooth.
struct PairMotion {
  Dual<kPairSize> linear;   ///< [m/s]
  Dual<kPairSize> angular;  ///< [rad/s]
};
/// Requires: dt > 0.
PairMotion MotionBetween(const base::Pose2& a, double dt, const base::Pose2& b);

/// (later - earlier) / time, of two neighbouring motions: change of speed over half of both times.
/// Unknowns are those of three poses and two times.
Dual<kTripleSize> AccelerationBetween(const Dual<kPairSize>& earlier, double earlier_dt,
                                      const Dual<kPairSize>& later, double later_dt);
/// From a speed that is given at the first pose (`is_start`) or held at the second.
Dual<kPairSize> AccelerationAtEnd(const Dual<kPairSize>& motion, double dt, double end_speed,
                                  bool is_start);

/// 0 where a and b lie on a common arc, tangent to both headings.
Dual<kPairSize> NonholonomicError(const base::Pose2& a, const base::Pose2& b);

/// Way from a to b along a's heading, [m]; below 0: backwards.
Dual<kPairSize> ForwardWay(const base::Pose2& a, const base::Pose2& b);

/// Straight distance, [m].
Dual<kPairSize> DistanceBetween(const base::Pose2& a, const base::Pose2& b);

/// Distance of a pose to a point, [m], by x, y and yaw.
Dual<3> DistanceToPoint(const base::Pose2& pose, base::Vec2 p);

}  // namespace slalom::planners
