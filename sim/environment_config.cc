#include "sim/environment_config.h"

#include <fmt/format.h>

#include <cmath>

#include "base/error.h"

namespace slalom::sim {

void CheckConsistent(const EnvironmentConfig& config) {
  const double substeps = config.episode.step * config.robot.control_rate;
  if (substeps < 0.5 || std::abs(substeps - std::round(substeps)) > 1e-6) {
    throw base::Error(fmt::format(
        "episode.step ({} s) times robot.control_rate ({} Hz) is {}, but must be a whole number",
        config.episode.step, config.robot.control_rate, substeps));
  }
  if (config.lidar.min_range >= config.lidar.max_range) {
    throw base::Error(fmt::format("lidar.min_range ({} m) must be below lidar.max_range ({} m)",
                                  config.lidar.min_range, config.lidar.max_range));
  }
  if (config.lidar.min_range >= config.observation.range_clip) {
    throw base::Error(
        fmt::format("lidar.min_range ({} m) must be below observation.range_clip ({} m)",
                    config.lidar.min_range, config.observation.range_clip));
  }
}

env::ObservationSpec MakeObservationSpec(const EnvironmentConfig& config) {
  return {.num_beams = config.lidar.num_beams,
          .range_clip = config.observation.range_clip,
          .goal_scale = config.observation.goal_scale};
}

int NumSubsteps(const EnvironmentConfig& config) {
  return static_cast<int>(std::lround(config.episode.step * config.robot.control_rate));
}

}  // namespace slalom::sim
