#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "sim/robot.h"

/// The drive's equations of motion in double precision, and an open field to drive on.

namespace slalom::sim {

inline constexpr double kGravity = 9.8;  // [m/s^2]
inline constexpr double kDt = 0.02;      // [s]
inline constexpr FrictionLaw kLaws[] = {FrictionLaw::kCone, FrictionLaw::kPyramid,
                                        FrictionLaw::kGazebo};

inline RobotConfig WithFriction(FrictionLaw law) {
  RobotConfig config;
  config.friction = law;
  return config;
}

/// Masses on the ground midway between wheels that touch it at one point each: closed forms hold.
inline RobotConfig Centred(FrictionLaw law = FrictionLaw::kCone) {
  RobotConfig config = WithFriction(law);
  config.centre_of_mass_x = config.centre_of_mass_y = config.centre_of_mass_z = 0.0;
  config.wheel_width = 0.0;
  return config;
}

/// The equations of motion in the body's frame, in double precision: what `SkidSteering` solves.
/// Velocity of the centre of mass, pose of the point midway between the wheels.
struct State {
  double ahead = 0.0, left = 0.0, yaw_rate = 0.0;  // [m/s], [rad/s]
  double x = 0.0, y = 0.0, yaw = 0.0;              // [m], [rad]
  double angle_left = 0.0, angle_right = 0.0;      // Of the wheels, [rad].
};

/// Force of the ground on a contact that slips, [N].
inline base::Vec2 Friction(const RobotConfig& config, double load, double slip_ahead,
                           double slip_left, double angle, double creep) {
  const double mu = config.wheel_friction;
  const auto sign = [&](double s) { return s / std::hypot(s, creep); };
  if (config.friction == FrictionLaw::kPyramid) {
    return {-mu * load * sign(slip_ahead), -mu * load * sign(slip_left)};
  }
  if (config.friction == FrictionLaw::kGazebo) {
    const double c = std::cos(angle), s = std::sin(angle);
    // Along (c, 0, -s) it is -mu normal sign(slip_ahead c); the vertical parts add up to the load.
    const double way = sign(slip_ahead) * (c < 0.0 ? -1.0 : 1.0);
    const double normal = load / (1.0 + mu * way * s);
    return {-mu * normal * way * c, -mu * normal * sign(slip_left) * std::abs(c)};
  }
  const double slip = std::sqrt(slip_ahead * slip_ahead + slip_left * slip_left + creep * creep);
  return {-mu * load * slip_ahead / slip, -mu * load * slip_left / slip};
}

inline State Derivative(const RobotConfig& config, const State& s, double wheel_left,
                        double wheel_right, double creep) {
  const double mass = config.mass, weight = mass * kGravity;
  const double cx = config.centre_of_mass_x, cy = config.centre_of_mass_y;
  const double a = 0.5 * config.wheel_base, b = 0.5 * config.track;
  double force_ahead = 0.0, force_left = 0.0, torque = 0.0;
  // Loads depend on the forces, which depend on the loads: a contraction by half at least.
  const int rounds = config.centre_of_mass_z > 0.0 ? 6 : 1;
  for (int round = 0; round < rounds; ++round) {
    const double lean_x = cx - force_ahead / weight * config.centre_of_mass_z;
    const double lean_y = cy - force_left / weight * config.centre_of_mass_z;
    force_ahead = force_left = torque = 0.0;
    for (const double wheel_x : {a, -a}) {
      for (const double wheel_y : {b, -b}) {
        const double load =
            0.25 * weight *
            std::max(0.0, 1.0 + lean_x * wheel_x / (a * a) + lean_y * wheel_y / (b * b));
        for (const double edge : {-0.5 * config.wheel_width, 0.5 * config.wheel_width}) {
          const double x = wheel_x - cx, y = wheel_y + edge - cy;
          const bool is_left = wheel_y > 0.0;
          const base::Vec2 force = Friction(
              config, 0.5 * load, s.ahead - s.yaw_rate * y - (is_left ? wheel_left : wheel_right),
              s.left + s.yaw_rate * x, is_left ? s.angle_left : s.angle_right, creep);
          force_ahead += force.x;
          force_left += force.y;
          torque += x * force.y - y * force.x;
        }
      }
    }
  }
  const double middle_ahead = s.ahead + s.yaw_rate * cy, middle_left = s.left - s.yaw_rate * cx;
  return {.ahead = force_ahead / mass + s.yaw_rate * s.left,
          .left = force_left / mass - s.yaw_rate * s.ahead,
          .yaw_rate = torque / config.yaw_inertia,
          .x = middle_ahead * std::cos(s.yaw) - middle_left * std::sin(s.yaw),
          .y = middle_ahead * std::sin(s.yaw) + middle_left * std::cos(s.yaw),
          .yaw = s.yaw_rate,
          .angle_left = wheel_left / config.wheel_radius,
          .angle_right = wheel_right / config.wheel_radius};
}

inline State Plus(const State& s, double h, const State& d) {
  return {.ahead = s.ahead + h * d.ahead,
          .left = s.left + h * d.left,
          .yaw_rate = s.yaw_rate + h * d.yaw_rate,
          .x = s.x + h * d.x,
          .y = s.y + h * d.y,
          .yaw = s.yaw + h * d.yaw,
          .angle_left = s.angle_left + h * d.angle_left,
          .angle_right = s.angle_right + h * d.angle_right};
}

/// The controller's wheel speeds, and its limits on how they change.
struct Controller {
  const RobotConfig& config;
  double linear = 0.0, angular = 0.0;  // [m/s], [rad/s]

  void Tick(double to_linear, double to_angular, double dt) {
    const double dv = config.linear_acceleration * dt, dw = config.angular_acceleration * dt;
    linear += std::clamp(to_linear - linear, -dv, dv);
    angular += std::clamp(to_angular - angular, -dw, dw);
  }
  double side() const { return 0.5 * config.track * config.wheel_separation_multiplier * angular; }
};

/// Midpoint rule with steps of 2e-5 s, a tenth of the fastest decay, creep / (friction x g).
inline void Integrate(Controller& controller, double linear, double angular, double duration,
                      State& s) {
  constexpr double kStep = 2e-5, kCreep = 1e-3;
  const int n = static_cast<int>(std::lround(duration / kStep));
  for (int i = 0; i < n; ++i) {
    controller.Tick(linear, angular, kStep);
    const double left = controller.linear - controller.side();
    const double right = controller.linear + controller.side();
    const State half = Plus(s, 0.5 * kStep, Derivative(controller.config, s, left, right, kCreep));
    s = Plus(s, kStep, Derivative(controller.config, half, left, right, kCreep));
  }
}

/// Drives on an open field, a rigid-body step at a time unless told otherwise.
class OpenField {
 public:
  explicit OpenField(const RobotConfig& config, int num_substeps = 1)
      : config_(config), robot_(config, num_substeps) {
    robot_.Reset({});
    robot_.TurnWheelsTo(0.0);
  }
  void Drive(double linear, double angular, int num_steps = 1) {
    for (int i = 0; i < num_steps; ++i) EXPECT_FALSE(robot_.Drive(linear, angular, scene_, 0.0));
  }
  base::Pose2 pose() const { return robot_.pose(); }
  const BodyState& body() const { return robot_.body(); }
  double speed() const { return std::hypot(robot_.body().vx, robot_.body().vy); }
  /// Velocity of the centre of mass in the directions `yaw` [rad].
  State CentreSeenFrom(double yaw) const {
    const BodyState& b = robot_.body();
    const double c = std::cos(yaw), s = std::sin(yaw);
    const double to_x =
        std::cos(b.yaw) * config_.centre_of_mass_x - std::sin(b.yaw) * config_.centre_of_mass_y;
    const double to_y =
        std::sin(b.yaw) * config_.centre_of_mass_x + std::cos(b.yaw) * config_.centre_of_mass_y;
    const double vx = b.vx - b.yaw_rate * to_y, vy = b.vy + b.yaw_rate * to_x;
    return {.ahead = c * vx + s * vy, .left = c * vy - s * vx, .yaw_rate = b.yaw_rate};
  }

 private:
  const RobotConfig config_;
  const Scene scene_{std::make_shared<const Course>()};
  Robot robot_;
};

/// Acceleration at which all four wheels slip, [m/s^2].
inline double SlipLimit(const RobotConfig& config) { return config.wheel_friction * kGravity; }

/// Velocity of a centre of mass in the directions of C.
struct Velocity {
  float ahead = 0.0f, left = 0.0f, yaw_rate = 0.0f;  // [m/s], [rad/s]
};

/// A step from `velocity` in the same directions, of which the search begins at `near`. Other lanes
/// are busy with something else.
inline Velocity Step(const SkidSteering& drive, const Velocity& velocity, const Velocity& near,
                     const WheelSpeeds& wheels, const std::array<float, 4>& angles = {}) {
  constexpr int kLane = 5;
  SkidLanes lanes;
  for (int lane = 0; lane < SkidLanes::kSize; ++lane) {
    drive.Enter(lanes, lane);
    lanes.ahead[lane] = 0.3f * static_cast<float>(lane);
    lanes.wheel_left[lane] = 1.0f;
  }
  lanes.ahead[kLane] = velocity.ahead;
  lanes.left[kLane] = velocity.left;
  lanes.yaw_rate[kLane] = velocity.yaw_rate;
  lanes.ahead_before[kLane] = 2.0f * velocity.ahead - near.ahead;
  lanes.left_before[kLane] = 2.0f * velocity.left - near.left;
  lanes.yaw_rate_before[kLane] = 2.0f * velocity.yaw_rate - near.yaw_rate;
  lanes.wheel_left[kLane] = wheels.left;
  lanes.wheel_right[kLane] = wheels.right;
  for (int wheel = 0; wheel < 4; ++wheel) lanes.angles[wheel][kLane] = angles[wheel];
  lanes.Step();
  return {lanes.ahead[kLane], lanes.left[kLane], lanes.yaw_rate[kLane]};
}

}  // namespace slalom::sim
