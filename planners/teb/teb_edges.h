#pragma once

#include <Eigen/Core>

#include "base/geometry.h"

/// The terms of TEB's least-squares problem, each with its derivatives, as in teb_local_planner's
/// g2o edges. An edge's error enters the cost as weight * error^2.
///
/// The unknowns of a band are one vector with four entries per pose: x, y, yaw, time to the next
/// pose [m, m, rad, s]. An edge depends on a run of them that begins with a pose.

namespace slalom::planners {

/// A number and its derivatives with respect to the N unknowns it depends on.
template <int N>
struct Dual {
  double value = 0.0;
  Eigen::Matrix<double, N, 1> gradient = Eigen::Matrix<double, N, 1>::Zero();
};

/// Number of unknowns of two poses and the time between them, and of three poses and two times.
inline constexpr int kPairSize = 7;
inline constexpr int kTripleSize = 11;

/// Distance of a value from an allowed range, 0 inside, and its slope: -1, 0 or 1. The ranges are
/// [low + margin, high - margin], and for `PenalizeBelow` [low + margin, infinity).
struct Penalty {
  double value = 0.0;
  double slope = 0.0;
};
Penalty PenalizeOutside(double value, double low, double high, double margin);
Penalty PenalizeBelow(double value, double low, double margin);

/// Speed and turn rate from pose a to pose b in the time dt. The distance is the straight one; its
/// sign, made smooth, is positive if b lies ahead of a.
struct PairMotion {
  Dual<kPairSize> linear;   ///< [m/s]
  Dual<kPairSize> angular;  ///< [rad/s]
};
/// Requires: dt > 0.
PairMotion MotionBetween(const base::Pose2& a, double dt, const base::Pose2& b);

/// Returns the acceleration between two neighbouring motions: (later - earlier) / half of both
/// times together. The unknowns are three poses and two times.
Dual<kTripleSize> AccelerationBetween(const Dual<kPairSize>& earlier, double earlier_dt,
                                      const Dual<kPairSize>& later, double later_dt);
/// Returns the acceleration between a motion and a given speed at its first pose (`is_start`) or at
/// its second pose.
Dual<kPairSize> AccelerationAtEnd(const Dual<kPairSize>& motion, double dt, double end_speed,
                                  bool is_start);

/// Returns an error that is 0 if a and b lie on a common arc, tangent to both headings.
Dual<kPairSize> NonholonomicError(const base::Pose2& a, const base::Pose2& b);

/// Returns the distance from a to b along a's heading, [m]; negative if b lies behind.
Dual<kPairSize> ForwardWay(const base::Pose2& a, const base::Pose2& b);

/// Returns the straight distance, [m].
Dual<kPairSize> DistanceBetween(const base::Pose2& a, const base::Pose2& b);

/// Returns the distance of a pose to a point, [m], with derivatives with respect to x, y and yaw.
Dual<3> DistanceToPoint(const base::Pose2& pose, base::Vec2 p);

}  // namespace slalom::planners
