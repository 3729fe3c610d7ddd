#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "base/geometry.h"
#include "planners/navigation/costmap.h"

/// Frames: `O` odometry (fixed to the ground), `R` the robot.

namespace slalom::planners {

/// A commanded or measured velocity of the robot, in R.
struct Twist {
  double linear = 0.0;   ///< Forwards, [m/s].
  double angular = 0.0;  ///< Counter-clockwise, [rad/s].

  friend bool operator==(const Twist&, const Twist&) = default;
};

/// Input of a local planner in one control cycle.
struct LocalView {
  base::Pose2 X_OR;
  Twist velocity;                      ///< Measured.
  const Costmap& costmap;              ///< Moves with the robot; inflated.
  std::span<const base::Vec2> path_O;  ///< Global plan from near the robot to the goal, [m], about
                                       ///< one point per cell.
  bool path_is_new = false;            ///< Whether there is a new plan since the last cycle.
  base::Vec2 goal_O;
};

/// The part of a classical navigation system that turns a plan into speeds: `DwaPlanner`,
/// `ElasticBandPlanner`, `TebPlanner`, `MppiPlanner`. Each robot needs one, as it keeps state from
/// cycle to cycle. Confined to one thread at a time.
class LocalPlanner {
 public:
  virtual ~LocalPlanner() = default;

  /// Forgets everything before a new episode. `seed` determines the planner's random numbers.
  virtual void Reset(std::uint64_t seed) = 0;

  /// Returns the command of this control cycle, or nothing if no command is admissible. The
  /// navigator then stops the robot and, if that lasts, starts a recovery.
  [[nodiscard]] virtual std::optional<Twist> ComputeCommand(const LocalView& view) = 0;
};

}  // namespace slalom::planners
