#pragma once

#include <array>

#include "sim/environment_config.h"

/// Frame: `R` the robot, x ahead, y left, at the point midway between the wheels.

namespace slalom::sim {

/// The masses of the robot as the plane sees them. A value.
struct MassDistribution {
  double mass = 0.0;         ///< With the sensor, [kg].
  double x = 0.0;            ///< Centre of mass in R, [m].
  double y = 0.0;            ///< [m]
  double height = 0.0;       ///< Of the centre of mass above the ground, [m].
  double yaw_inertia = 0.0;  ///< About the vertical through the centre of mass, [kg m^2].
  /// The part of the weight that each wheel carries at rest: front left, front right, rear left,
  /// rear right. Their sum is 1.
  std::array<double, 4> loads{};
};

/// Adds the sensor, a point, to chassis and wheels and shares the weight out among the wheels.
///
/// The balance of forces and moments leaves one load free, as four wheels are one more than a body
/// needs. On ground that gives way alike under each of them the loads are those of a flat tilt:
///
///     load = 1/4 (1 + X x / a^2 + Y y / b^2)
///
/// at a wheel (X, Y) = (+-a, +-b), a = wheel_base / 2, b = track / 2, for a centre of mass (x, y).
/// A body that accelerates by (ax, ay) leans as if the centre of mass were at (x, y) - height / g
/// (ax, ay).
///
/// The ideal drive does not slip, so where the mass is does not matter to it: it counts as being
/// midway between the wheels, without the sensor.
MassDistribution DistributeMass(const RobotConfig& config);

/// Throws `base::Error`, which names the keys, where a wheel would carry nothing: the centre of
/// mass must lie within |x| / a + |y| / b < 1.
void CheckMassDistribution(const RobotConfig& config);

}  // namespace slalom::sim
