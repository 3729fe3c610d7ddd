#pragma once

#include "planners/planner_registry.h"
#include "sim/environment_config.h"

namespace slalom::train {

/// Lets the planners drive the robot of `environment`, whatever it is. A setting that is at its
/// default follows the robot where it contradicts it: outlines and distances from obstacles are
/// those of its body, and no limit of speed or acceleration is above its own. Any other value
/// stays, and a warning says if it contradicts the robot. Nothing changes for the default robot.
void FitToRobot(const sim::EnvironmentConfig& environment, planners::PlannersConfig& planners);

}  // namespace slalom::train
