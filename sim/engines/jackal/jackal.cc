#include "sim/engines/jackal/jackal.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "sim/engines/jackal/world.h"

namespace slalom::engines {
namespace {

// docs/original-system.md, section 1.1.
const Eigen::Matrix3d kChassisInertia{
    {0.3136, -0.0008, 0.0164}, {-0.0008, 0.3922, -0.0009}, {0.0164, -0.0009, 0.4485}};
constexpr double kAxleHeight = 0.0345;    // Height of the axles in C, [m].
constexpr double kThinnestWheel = 0.001;  // A body needs some width, [m].
constexpr double kWheelMass = 0.477;
const Eigen::Vector3d kWheelInertia{0.0013, 0.0024, 0.0013};
const Box3 kChassisBox = {{0.0, 0.0, 0.092}, {0.21, 0.155, 0.092}};
constexpr double kObstacleFriction = 0.5;

constexpr double kSameLength = 1e-3;  // [m]

/// Moment of inertia of the wheels about the vertical through the centre of mass, [kg m^2].
double WheelsYawInertia(const sim::RobotConfig& config) {
  const double x = 0.5 * config.wheel_base, y = 0.5 * config.track;
  const double dx = config.centre_of_mass_x, dy = config.centre_of_mass_y;
  return kNumWheels * (kWheelInertia[2] + kWheelMass * (x * x + y * y + dx * dx + dy * dy));
}

void RequireBuildable(const sim::RobotConfig& config, std::string_view physics) {
  base::ThrowIf(
      config.drive != sim::DriveKind::kSkidSteer,
      "environment.robot.drive is \"ideal\", expected \"skid-steer\" in physics {}, whose wheels "
      "slip as they must",
      physics);
  base::ThrowIf(
      config.wheel_radius <= kAxleHeight || config.wheel_radius >= kObstacleHalfHeight,
      "environment.robot.wheel_radius is {} m, expected between {} and {} in physics {}, so that "
      "the chassis is above the ground and not above the obstacles",
      config.wheel_radius, kAxleHeight, kObstacleHalfHeight, physics);
  const double wheels = kNumWheels * kWheelMass;
  base::ThrowIf(
      config.mass <= wheels,
      "environment.robot.mass is {} kg, expected more than the {} kg of the wheels in physics {}",
      config.mass, wheels, physics);
  base::ThrowIf(
      config.yaw_inertia <= WheelsYawInertia(config),
      "environment.robot.yaw_inertia is {} kg m^2, expected more than the {:.4f} kg m^2 of the "
      "wheels in physics {}",
      config.yaw_inertia, WheelsYawInertia(config), physics);
}

/// Whether the outline is the one of chassis and wheels together.
bool OutlineIsFilled(const sim::RobotConfig& config) {
  const double length =
      std::max(config.wheel_base + 2.0 * config.wheel_radius, 2.0 * kChassisBox.half_size[0]);
  const double width = std::max(config.track + config.wheel_width, 2.0 * kChassisBox.half_size[1]);
  return std::abs(config.length - length) < kSameLength &&
         std::abs(config.width - width) < kSameLength;
}

/// Gives the chassis its mass, its centre and its inertia: the robot's without the wheels'.
void SpreadMass(const sim::RobotConfig& config, std::string_view physics, Jackal& jackal) {
  const double mass = jackal.chassis_mass = config.mass - kNumWheels * kWheelMass;
  const double share = config.mass / mass;
  // Above the ground.
  const Eigen::Vector3d robots_centre{config.centre_of_mass_x, config.centre_of_mass_y,
                                      config.centre_of_mass_z};
  const Eigen::Vector3d wheels_centre{0.0, 0.0, config.wheel_radius};
  const Eigen::Vector3d centre = share * robots_centre - (share - 1.0) * wheels_centre;
  jackal.chassis_centre_C = centre - Eigen::Vector3d{0.0, 0.0, jackal.height};
  const double yaw_inertia = config.yaw_inertia - WheelsYawInertia(config) -
                             mass * (centre - robots_centre).head<2>().squaredNorm();
  base::ThrowIf(
      yaw_inertia <= 0.0,
      "environment.robot.yaw_inertia is {} kg m^2, expected more than {:.4f}, which wheels and a "
      "chassis with its mass at ({:.3f}, {:.3f}) m have in physics {}",
      config.yaw_inertia, config.yaw_inertia - yaw_inertia, centre.x(), centre.y(), physics);
  // All of the tensor, so that it remains one that a body can have.
  jackal.chassis_inertia = yaw_inertia / kChassisInertia(2, 2) * kChassisInertia;
}

/// Makes the sensor, a point, part of the chassis.
void AddSensor(const sim::RobotConfig& config, Jackal& jackal) {
  const Eigen::Vector3d sensor_C{config.sensor_x, 0.0, config.sensor_z - jackal.height};
  const double mass = jackal.chassis_mass + config.sensor_mass;
  const double reduced_mass = jackal.chassis_mass * config.sensor_mass / mass;
  const Eigen::Vector3d d = sensor_C - jackal.chassis_centre_C;
  jackal.chassis_centre_C += config.sensor_mass / mass * d;
  // The parallel axis theorem, d^2 - d d^T, as a product in which nothing cancels out.
  const Eigen::Matrix3d cross{{0.0, -d.z(), d.y()}, {d.z(), 0.0, -d.x()}, {-d.y(), d.x(), 0.0}};
  const Eigen::Matrix3d squared_arms = cross.transpose() * cross;
  jackal.chassis_inertia += reduced_mass * squared_arms;
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
