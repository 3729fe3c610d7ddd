#include "sim/engines/jackal/jackal.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace slalom::engines {
namespace {

// docs/original-system.md, section 1.1.
constexpr std::array<double, 6> kChassisInertia = {0.3136,  0.3922, 0.4485,
                                                   -0.0008, 0.0164, -0.0009};
constexpr double kAxleHeight = 0.0345;    // Of the axles in C, [m].
constexpr double kThinnestWheel = 0.001;  // A body needs some width, [m].
constexpr double kWheelMass = 0.477;
constexpr Vec3 kWheelInertia = {0.0013, 0.0024, 0.0013};
constexpr Box3 kChassisBox = {{0.0, 0.0, 0.092}, {0.21, 0.155, 0.092}};
constexpr double kObstacleFriction = 0.5;

constexpr double kSameLength = 1e-3;  // [m]

/// Moment of inertia of the wheels about the vertical through the centre of mass, [kg m^2].
double WheelsYawInertia(const sim::RobotConfig& config) {
  const double x = 0.5 * config.wheel_base, y = 0.5 * config.track;
  const double dx = config.centre_of_mass_x, dy = config.centre_of_mass_y;
  return kNumWheels * (kWheelInertia[2] + kWheelMass * (x * x + y * y + dx * dx + dy * dy));
}

void RequireBuildable(const sim::RobotConfig& config, std::string_view physics) {
  if (config.drive != sim::DriveKind::kSkidSteer) {
    throw base::Error(fmt::format(
        "environment.robot.drive is \"ideal\", expected \"skid-steer\" in physics {}, whose wheels "
        "slip as they must",
        physics));
  }
  if (config.wheel_radius <= kAxleHeight || config.wheel_radius >= kObstacleHalfHeight) {
    throw base::Error(fmt::format(
        "environment.robot.wheel_radius is {} m, expected between {} and {} in physics {}, so that "
        "the chassis is above the ground and not above the obstacles",
        config.wheel_radius, kAxleHeight, kObstacleHalfHeight, physics));
  }
  const double wheels = kNumWheels * kWheelMass;
  if (config.mass <= wheels) {
    throw base::Error(
        fmt::format("environment.robot.mass is {} kg, expected more than the {} kg of the wheels "
                    "in physics {}",
                    config.mass, wheels, physics));
  }
  if (config.yaw_inertia <= WheelsYawInertia(config)) {
    throw base::Error(
        fmt::format("environment.robot.yaw_inertia is {} kg m^2, expected more than the {:.4f} "
                    "kg m^2 of the wheels in physics {}",
                    config.yaw_inertia, WheelsYawInertia(config), physics));
  }
}

/// Whether the outline is that of chassis and wheels together.
bool OutlineIsFilled(const sim::RobotConfig& config) {
  const double length =
      std::max(config.wheel_base + 2.0 * config.wheel_radius, 2.0 * kChassisBox.half_size[0]);
  const double width = std::max(config.track + config.wheel_width, 2.0 * kChassisBox.half_size[1]);
  return std::abs(config.length - length) < kSameLength &&
         std::abs(config.width - width) < kSameLength;
}

/// Gives the chassis its mass, its centre and its inertia: what the wheels leave of the robot's.
void SpreadMass(const sim::RobotConfig& config, std::string_view physics, Jackal& jackal) {
  const double mass = jackal.chassis_mass = config.mass - kNumWheels * kWheelMass;
  const double share = config.mass / mass;
  const double x = share * config.centre_of_mass_x, y = share * config.centre_of_mass_y;
  const double z = share * config.centre_of_mass_z - (share - 1.0) * config.wheel_radius;
  jackal.chassis_centre_C = {x, y, z - jackal.height};
  const double dx = x - config.centre_of_mass_x, dy = y - config.centre_of_mass_y;
  const double yaw_inertia =
      config.yaw_inertia - WheelsYawInertia(config) - mass * (dx * dx + dy * dy);
  if (yaw_inertia <= 0.0) {
    throw base::Error(fmt::format(
        "environment.robot.yaw_inertia is {} kg m^2, expected more than {:.4f}, which wheels and a "
        "chassis with its mass at ({:.3f}, {:.3f}) m have in physics {}",
        config.yaw_inertia, config.yaw_inertia - yaw_inertia, x, y, physics));
  }
  // All of the tensor, so that it remains one that a body can have.
  for (std::size_t k = 0; k < kChassisInertia.size(); ++k) {
    jackal.chassis_inertia[k] = yaw_inertia / kChassisInertia[2] * kChassisInertia[k];
  }
}

/// Makes the sensor, a point, part of the chassis.
void AddSensor(const sim::RobotConfig& config, Jackal& jackal) {
  const Vec3 sensor_C = {config.sensor_x, 0.0, config.sensor_z - jackal.height};
  const double mass = jackal.chassis_mass + config.sensor_mass;
  const double reduced_mass = jackal.chassis_mass * config.sensor_mass / mass;
  Vec3 d;  // From the chassis' centre to the sensor.
  for (int k = 0; k < 3; ++k) {
    d[k] = sensor_C[k] - jackal.chassis_centre_C[k];
    jackal.chassis_centre_C[k] += config.sensor_mass / mass * d[k];
  }
  const std::array<double, 6> both = {d[1] * d[1] + d[2] * d[2],
                                      d[0] * d[0] + d[2] * d[2],
                                      d[0] * d[0] + d[1] * d[1],
                                      -d[0] * d[1],
                                      -d[0] * d[2],
                                      -d[1] * d[2]};
  for (std::size_t k = 0; k < both.size(); ++k) {
    jackal.chassis_inertia[k] += reduced_mass * both[k];
  }
  jackal.chassis_mass = mass;
}

}  // namespace

Jackal MakeJackal(const sim::RobotConfig& config, std::string_view physics) {
  RequireBuildable(config, physics);
  Jackal jackal;
  jackal.height = config.wheel_radius - kAxleHeight;
  SpreadMass(config, physics, jackal);
  if (config.sensor_mass > 0.0) AddSensor(config, jackal);
  jackal.wheel_radius = config.wheel_radius;
  jackal.wheel_half_width = 0.5 * std::max(config.wheel_width, kThinnestWheel);
  jackal.wheel_mass = kWheelMass;
  jackal.wheel_inertia = kWheelInertia;
  for (int wheel = 0; wheel < kNumWheels; ++wheel) {
    jackal.wheels_C[wheel] = {(wheel < 2 ? 0.5 : -0.5) * config.wheel_base,
                              (IsLeft(wheel) ? 0.5 : -0.5) * config.track, kAxleHeight};
  }
  jackal.wheel_friction = config.wheel_friction;
  jackal.obstacle_friction = kObstacleFriction;
  jackal.wheels_meet_obstacles = OutlineIsFilled(config);
  jackal.outline = kChassisBox;
  if (!jackal.wheels_meet_obstacles) {
    jackal.outline.half_size[0] = 0.5 * config.length;
    jackal.outline.half_size[1] = 0.5 * config.width;
  }
  return jackal;
}

}  // namespace slalom::engines
