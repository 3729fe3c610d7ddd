#pragma once

#include <array>

#include "sim/environment_config.h"

/// Frame: `R` the robot, x ahead, y left, at the point midway between the wheels.

namespace slalom::sim {

/// The robot's mass, centre of mass, inertia and wheel loads, for motion in the plane. A value.
struct MassDistribution {
  double mass = 0.0;         ///< With the sensor, [kg].
  double x = 0.0;            ///< Centre of mass in R, [m].
  double y = 0.0;            ///< [m]
  double height = 0.0;       ///< Height of the centre of mass above the ground, [m].
  double yaw_inertia = 0.0;  ///< About the vertical through the centre of mass, [kg m^2].
  /// The share of the weight on each wheel at rest: front left, front right, rear left, rear right.
  /// The shares sum to 1.
  std::array<double, 4> loads{};
};

/// Adds the sensor, as a point, to chassis and wheels, and distributes the weight over the wheels.
///
/// The balance of forces and moments leaves one load free, because four wheels are one more than a
/// body needs. If the ground is equally soft under all of them, the loads are as in a flat tilt:
///
///     load = 1/4 (1 + X x / a^2 + Y y / b^2)
///
/// at a wheel (X, Y) = (+-a, +-b), a = wheel_base / 2, b = track / 2, for a centre of mass (x, y).
/// A body that accelerates by (ax, ay) leans as if the centre of mass were at (x, y) - height / g
/// (ax, ay).
///
/// The ideal drive does not slip, so the place of the mass does not matter. The mass counts as
/// being midway between the wheels, without the sensor.
MassDistribution DistributeMass(const RobotConfig& config);

/// Throws `base::Error` that names the keys if a wheel would carry nothing: the centre of mass must
/// satisfy |x| / a + |y| / b < 1.
void CheckMassDistribution(const RobotConfig& config);

}  // namespace slalom::sim
