#include "engines/jackal/jackal.h"

#include <fmt/format.h>

#include <cmath>

#include "base/error.h"

namespace slalom::engines {
namespace {

// docs/original-system.md, section 1.1.
constexpr Vec3 kChassisCentre = {0.012, 0.002, 0.067};
constexpr std::array<double, 6> kChassisInertia = {0.3136,  0.3922, 0.4485,
                                                   -0.0008, 0.0164, -0.0009};
constexpr double kAxleHeight = 0.0345;  // Of the axles in C, [m].
constexpr double kWheelRadius = 0.098;
constexpr double kWheelHalfWidth = 0.02;
constexpr double kWheelMass = 0.477;
constexpr Vec3 kWheelInertia = {0.0013, 0.0024, 0.0013};
constexpr Box3 kChassisBox = {{0.0, 0.0, 0.092}, {0.21, 0.155, 0.092}};
constexpr double kObstacleFriction = 0.5;

constexpr double kSameLength = 1e-3;  // [m]

/// Moment of inertia of the wheels about the vertical through the robot's centre, [kg m^2].
double WheelsYawInertia(const sim::RobotConfig& config) {
  const double x = 0.5 * config.wheel_base, y = 0.5 * config.track;
  return kNumWheels * (kWheelInertia[2] + kWheelMass * (x * x + y * y));
}

void RequireBuildable(const sim::RobotConfig& config, std::string_view physics) {
  if (config.drive != sim::DriveKind::kSkidSteer) {
    throw base::Error(fmt::format(
        "environment.robot.drive is \"ideal\", expected \"skid-steer\" in physics {}, whose wheels "
        "slip as they must",
        physics));
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
      std::max(config.wheel_base + 2.0 * kWheelRadius, 2.0 * kChassisBox.half_size[0]);
  const double width =
      std::max(config.track + 2.0 * kWheelHalfWidth, 2.0 * kChassisBox.half_size[1]);
  return std::abs(config.length - length) < kSameLength &&
         std::abs(config.width - width) < kSameLength;
}

}  // namespace

Jackal MakeJackal(const sim::RobotConfig& config, std::string_view physics) {
  RequireBuildable(config, physics);
  Jackal jackal;
  jackal.chassis_mass = config.mass - kNumWheels * kWheelMass;
  jackal.chassis_centre_C = kChassisCentre;
  // All of the tensor, so that it remains one that a body can have.
  const double scale = (config.yaw_inertia - WheelsYawInertia(config)) / kChassisInertia[2];
  for (std::size_t k = 0; k < kChassisInertia.size(); ++k) {
    jackal.chassis_inertia[k] = scale * kChassisInertia[k];
  }
  jackal.height = kWheelRadius - kAxleHeight;
  jackal.wheel_radius = kWheelRadius;
  jackal.wheel_half_width = kWheelHalfWidth;
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
