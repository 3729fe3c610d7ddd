#include "sim/environment_config.h"

#include <fmt/format.h>

#include <cmath>

#include "base/error.h"
#include "sim/mass_distribution.h"
#include "sim/randomized_config.h"

namespace slalom::sim {

void CheckConsistent(const EnvironmentConfig& config) {
  const double substeps = config.episode.step * config.robot.control_rate;
  if (substeps < 0.5 || std::abs(substeps - std::round(substeps)) > 1e-6) {
    throw base::Error(fmt::format(
        "environment.episode.step ({} s) times environment.robot.control_rate ({} Hz) is {:.6g}, "
        "expected a whole number",
        config.episode.step, config.robot.control_rate, substeps));
  }
  CheckMassDistribution(config.robot);
  if (config.robot.drive == DriveKind::kSkidSteer &&
      config.robot.wheel_width >= config.robot.track) {
    throw base::Error(fmt::format(
        "environment.robot.wheel_width ({} m) must be below environment.robot.track ({} m)",
        config.robot.wheel_width, config.robot.track));
  }
  if (config.robot.drive == DriveKind::kSkidSteer &&
      config.robot.friction == FrictionLaw::kGazebo && config.robot.wheel_friction >= 1.0) {
    throw base::Error(
        fmt::format("environment.robot.wheel_friction is {}, expected less than 1 with "
                    "environment.robot.friction "
                    "= \"gazebo\": friction that presses a wheel down would grow without bound",
                    config.robot.wheel_friction));
  }
  if (config.lidar.min_range >= config.lidar.max_range) {
    throw base::Error(fmt::format(
        "environment.lidar.min_range ({} m) must be below environment.lidar.max_range ({} m)",
        config.lidar.min_range, config.lidar.max_range));
  }
  if (config.lidar.min_range >= config.observation.range_clip) {
    throw base::Error(
        fmt::format("environment.lidar.min_range ({} m) must be below "
                    "environment.observation.range_clip ({} m)",
                    config.lidar.min_range, config.observation.range_clip));
  }
  CheckRandomization(config);
}

env::ObservationSpec MakeObservationSpec(const EnvironmentConfig& config) {
  const ObservationConfig& observation = config.observation;
  return {observation, config.lidar.num_beams, env::StateSize(observation), observation.range_clip,
          observation.goal_scale};
}

int NumSubsteps(const EnvironmentConfig& config) {
  return static_cast<int>(std::lround(config.episode.step * config.robot.control_rate));
}

}  // namespace slalom::sim
