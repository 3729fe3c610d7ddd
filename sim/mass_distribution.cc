#include "sim/mass_distribution.h"

#include <cmath>

#include "base/error.h"

namespace slalom::sim {

MassDistribution DistributeMass(const RobotConfig& config) {
  if (config.drive == DriveKind::kIdeal) {
    return {
        .mass = config.mass, .yaw_inertia = config.yaw_inertia, .loads = {0.25, 0.25, 0.25, 0.25}};
  }
  const double mass = config.mass + config.sensor_mass;
  const double x =
      (config.mass * config.centre_of_mass_x + config.sensor_mass * config.sensor_x) / mass;
  const double y = config.mass * config.centre_of_mass_y / mass;
  const double z =
      (config.mass * config.centre_of_mass_z + config.sensor_mass * config.sensor_z) / mass;
  // Two masses turn about their common centre.
  const double dx = config.sensor_x - config.centre_of_mass_x, dy = -config.centre_of_mass_y;
  const double reduced_mass = config.mass * config.sensor_mass / mass;
  const double tilt_x = x / (0.5 * config.wheel_base), tilt_y = y / (0.5 * config.track);
  return {.mass = mass,
          .x = x,
          .y = y,
          .height = z,
          .yaw_inertia = config.yaw_inertia + reduced_mass * (dx * dx + dy * dy),
          .loads = {0.25 * (1.0 + tilt_x + tilt_y), 0.25 * (1.0 + tilt_x - tilt_y),
                    0.25 * (1.0 - tilt_x + tilt_y), 0.25 * (1.0 - tilt_x - tilt_y)}};
}

void CheckMassDistribution(const RobotConfig& config) {
  const MassDistribution masses = DistributeMass(config);
  const double lean =
      std::abs(masses.x) / (0.5 * config.wheel_base) + std::abs(masses.y) / (0.5 * config.track);
  if (lean < 1.0) return;
  throw base::Error(
      "environment.robot: the centre of mass is at ({:.4g} m, {:.4g} m) from the point midway "
      "between the wheels (centre_of_mass_x, centre_of_mass_y, sensor_mass, sensor_x), where not "
      "every wheel carries weight: |x| / (wheel_base / 2) + |y| / (track / 2) is {:.4g}, expected "
      "less than 1",
      masses.x, masses.y, lean);
}

}  // namespace slalom::sim
