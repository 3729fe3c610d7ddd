#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "base/geometry.h"
#include "planners/costmap.h"

/// Frames: `O` odometry (fixed to the ground), `R` the robot.

namespace slalom::planners {

/// A commanded or measured velocity of the robot, in R.
struct Twist {
  double linear = 0.0;   ///< Forwards, [m/s].
  double angular = 0.0;  ///< Counter-clockwise, [rad/s].

  friend bool operator==(const Twist&, const Twist&) = default;
};

/// What a local planner sees in one control cycle.
struct LocalView {
  base::Pose2 X_OR;
  Twist velocity;                      ///< Measured.
  const Costmap& costmap;              ///< Rolls with the robot; inflated.
  std::span<const base::Vec2> path_O;  ///< Global plan from near the robot to the goal, [m], about
                                       ///< one point per cell.
  bool path_is_new = false;            ///< Planned anew since the last cycle.
  base::Vec2 goal_O;
};

/// The part of a classical navigation system that turns a plan into speeds: `DwaPlanner`,
/// `ElasticBandPlanner`, `TebPlanner`, `MppiPlanner`. One per robot; keeps what it needs from cycle
/// to cycle. Confined to one thread at a time.
class LocalPlanner {
 public:
  virtual ~LocalPlanner() = default;

  /// Forgets everything: a new episode begins. `seed`: of whatever the planner draws.
  virtual void Reset(std::uint64_t seed) = 0;

  /// The command of this control cycle. None: there is no admissible one; the navigator stops the
  /// robot and, if that lasts, recovers.
  [[nodiscard]] virtual std::optional<Twist> ComputeCommand(const LocalView& view) = 0;
};

}  // namespace slalom::planners
