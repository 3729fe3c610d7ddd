#pragma once

#include <span>

#include "sim/environment_config.h"
#include "sim/moving_obstacles.h"
#include "sim/robot_body.h"

namespace slalom::sim {

/// Writes what no sensor tells, as `env::kPrivilegedSize` says: the robot's true speeds, the moving
/// obstacles that are nearest at motion time `motion_time` [s], and the robot's drive. `config`: of
/// the episode, with the values that were drawn for it.
/// Requires: numbers.size() == env::kPrivilegedSize.
void WritePrivileged(const EnvironmentConfig& config, const RobotBody& robot,
                     const MovingObstacles& moving, double motion_time, std::span<float> numbers);

}  // namespace slalom::sim
