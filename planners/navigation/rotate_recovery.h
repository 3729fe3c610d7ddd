#pragma once

#include <optional>

#include "base/geometry.h"
#include "planners/navigation/costmap.h"
#include "planners/navigation/footprint.h"
#include "planners/navigation/navigation_config.h"

namespace slalom::planners {

/// Turns the robot left by a full circle, as ROS's rotate_recovery: half a circle first, then on to
/// the heading it began with. In each cycle it turns as fast as it can still stop in time. A value.
class RotateRecovery {
 public:
  /// Begins a turn at this heading, [rad].
  explicit RotateRecovery(double yaw) : start_yaw_(yaw) {}

  /// Returns the turn rate of this cycle, [rad/s], or nothing if the turn is complete or the
  /// outline would hit something in the rest of it. Cost: up to 370 checks of the outline.
  std::optional<double> TurnRate(const NavigationConfig& config, const PaddedFootprint& footprint,
                                 const Costmap& costmap, const base::Pose2& X_OR);

 private:
  double start_yaw_;
  bool half_done_ = false;
};

}  // namespace slalom::planners
