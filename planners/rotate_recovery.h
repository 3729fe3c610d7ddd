#pragma once

#include <optional>

#include "base/geometry.h"
#include "planners/costmap.h"
#include "planners/footprint.h"
#include "planners/navigation_config.h"

namespace slalom::planners {

/// Turns the robot once round, left, as ROS's rotate_recovery: half a circle and the way back to
/// the heading it began with, at each cycle as fast as it could still stop in time. A value.
class RotateRecovery {
 public:
  /// Begins a turn at this heading, [rad].
  explicit RotateRecovery(double yaw) : start_yaw_(yaw) {}

  /// The turn rate of this cycle, [rad/s]. None: the turn is complete, or the outline would hit
  /// something on what is left of it. Cost: up to 370 outlines.
  std::optional<double> TurnRate(const NavigationConfig& config, const Footprint& footprint,
                                 const Costmap& costmap, const base::Pose2& X_OR);

 private:
  double start_yaw_;
  bool half_done_ = false;
};

}  // namespace slalom::planners
