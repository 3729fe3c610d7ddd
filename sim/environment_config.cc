#include "sim/environment_config.h"

#include <cmath>

#include "base/error.h"
#include "sim/mass_distribution.h"
#include "sim/randomized_config.h"

namespace slalom::sim {

void CheckConsistent(const EnvironmentConfig& config) {
  const double substeps = config.episode.step * config.robot.control_rate;
  base::ThrowIf(
      substeps < 0.5 || std::abs(substeps - std::round(substeps)) > 1e-6,
      "environment.episode.step ({} s) times environment.robot.control_rate ({} Hz) is {:.6g}, "
      "expected a whole number",
      config.episode.step, config.robot.control_rate, substeps);
  CheckMassDistribution(config.robot);
  base::ThrowIf(
      config.robot.drive == DriveKind::kSkidSteer && config.robot.wheel_width >= config.robot.track,
      "environment.robot.wheel_width ({} m) must be below environment.robot.track ({} m)",
      config.robot.wheel_width, config.robot.track);
  base::ThrowIf(
      config.robot.drive == DriveKind::kSkidSteer &&
          config.robot.friction == FrictionLaw::kGazebo && config.robot.wheel_friction >= 1.0,
      "environment.robot.wheel_friction is {}, expected less than 1 with "
      "environment.robot.friction = \"gazebo\": friction that presses a wheel down would grow "
      "without bound",
      config.robot.wheel_friction);
  base::ThrowIf(
      config.lidar.min_range >= config.lidar.max_range,
      "environment.lidar.min_range ({} m) must be below environment.lidar.max_range ({} m)",
      config.lidar.min_range, config.lidar.max_range);
  base::ThrowIf(
      config.lidar.min_range >= config.observation.range_clip,
      "environment.lidar.min_range ({} m) must be below environment.observation.range_clip ({} "
      "m)",
      config.lidar.min_range, config.observation.range_clip);
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
