#pragma once

#include <vector>

#include "base/geometry.h"
#include "sim/courses/course.h"

/// Frames: `W` the course's own frame, `B` the moving obstacle.

namespace slalom::sim {

/// Pose and velocity of a moving obstacle. A value.
struct MotionState {
  base::Pose2 X_WB;       ///< The heading is not wrapped within a round: it may exceed pi.
  base::Vec2 v_B;         ///< Velocity of B's origin in W, [m/s].
  double yaw_rate = 0.0;  ///< [rad/s]
};

/// The motion of an obstacle through its key frames, as Gazebo plays an animation
/// (docs/original-system.md, section 7.4; gazebo/common/Animation.cc, gz-math Spline.cc and
/// RotationSpline.cc).
///
/// Between two key frames, x and y are cubics of the elapsed fraction u of the time between them.
/// Their slope per u at a key frame is half the way from the key frame before it to the one after
/// it. At the first and the last key frame it is half the way to the only neighbour, unless these
/// two are at the same place (a closed round): then it is half the way from the last but one to the
/// second. With two key frames alone the obstacle has therefore gone 0.5 u + 1.5 u^2 - u^3 of the
/// way. The heading turns at a constant rate, the shorter way round: Gazebo's rotation spline is
/// cubic only if roll, pitch and yaw all differ, which they never do in the plane.
///
/// Motion time 0 is the first key frame. After the last one, a looping obstacle jumps to the first,
/// and a ping-pong obstacle goes the same way back.
///
/// Immutable. Gives the same bits on every machine. `At` does not allocate.
class Motion {
 public:
  /// Requires: two or more key frames, times strictly ascending from 0.
  explicit Motion(const MovingObstacle& obstacle);

  /// The state at motion time `time` [s]. At the exact time of a jump the obstacle is already at
  /// the first key frame. Requires: time >= 0. Cost: about 20 ns, growing with the logarithm of the
  /// number of key frames.
  MotionState At(double time) const;

  /// Duration of a round, [s]: one way, or with ping-pong both ways.
  double period() const { return period_; }
  /// Speed that B's origin never exceeds, apart from jumps, [m/s].
  double max_speed() const { return max_speed_; }
  /// Turn rate that is never exceeded, apart from jumps, [rad/s].
  double max_yaw_rate() const { return max_yaw_rate_; }
  /// Whether a looping obstacle begins a new round in (time, time + duration], both in [s].
  bool BeginsRound(double time, double duration) const;

 private:
  /// c0 + c1 u + c2 u^2 + c3 u^3.
  struct Cubic {
    double c0, c1, c2, c3;
  };
  struct KeyFrameInterval {
    double begin;             // [s]
    double inverse_duration;  // [1/s]
    Cubic x, y;
    double yaw, yaw_step;  // At the begin; from there to the end, [rad].
  };

  std::vector<KeyFrameInterval> intervals_;
  double one_way_;  // [s]
  double period_;
  bool loops_;
  double max_speed_ = 0.0;
  double max_yaw_rate_ = 0.0;
};

}  // namespace slalom::sim
