#include "sim/skid_steering.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "base/random.h"
#include "sim/robot.h"

namespace slalom::sim {
namespace {

constexpr double kGravity = 9.8;  // [m/s^2]
constexpr double kDt = 0.02;      // [s]

/// The equations of motion in the body's frame, in double precision: what `SkidSteering` solves.
struct State {
  double ahead = 0.0, left = 0.0, yaw_rate = 0.0;  // [m/s], [rad/s]
  double x = 0.0, y = 0.0, yaw = 0.0;              // [m], [rad]
};

State Derivative(const RobotConfig& config, const State& s, double wheel_left, double wheel_right,
                 double creep) {
  const double load = 0.25 * config.mass * kGravity;
  double force_ahead = 0.0, force_left = 0.0, torque = 0.0;
  for (const double x : {0.5 * config.wheel_base, -0.5 * config.wheel_base}) {
    for (const double y : {0.5 * config.track, -0.5 * config.track}) {
      const double slip_ahead = s.ahead - s.yaw_rate * y - (y > 0.0 ? wheel_left : wheel_right);
      const double slip_left = s.left + s.yaw_rate * x;
      const double per_slip =
          -config.wheel_friction * load /
          std::sqrt(slip_ahead * slip_ahead + slip_left * slip_left + creep * creep);
      force_ahead += per_slip * slip_ahead;
      force_left += per_slip * slip_left;
      torque += per_slip * (x * slip_left - y * slip_ahead);
    }
  }
  return {.ahead = force_ahead / config.mass + s.yaw_rate * s.left,
          .left = force_left / config.mass - s.yaw_rate * s.ahead,
          .yaw_rate = torque / config.yaw_inertia,
          .x = s.ahead * std::cos(s.yaw) - s.left * std::sin(s.yaw),
          .y = s.ahead * std::sin(s.yaw) + s.left * std::cos(s.yaw),
          .yaw = s.yaw_rate};
}

State Plus(const State& s, double h, const State& d) {
  return {s.ahead + h * d.ahead, s.left + h * d.left, s.yaw_rate + h * d.yaw_rate,
          s.x + h * d.x,         s.y + h * d.y,       s.yaw + h * d.yaw};
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
void Integrate(Controller& controller, double linear, double angular, double duration, State& s) {
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
      : contacts_(config), robot_(config, num_substeps) {
    robot_.Reset({});
  }
  void Drive(double linear, double angular, int num_steps = 1) {
    for (int i = 0; i < num_steps; ++i) {
      EXPECT_FALSE(robot_.Drive(linear, angular, scene_, 0.0, contacts_));
    }
  }
  base::Pose2 pose() const { return robot_.pose(); }
  const BodyState& body() const { return robot_.body(); }
  double speed() const { return std::hypot(robot_.body().vx, robot_.body().vy); }

 private:
  const Scene scene_{std::make_shared<const Course>()};
  ContactWorld contacts_;
  Robot robot_;
};

/// Acceleration at which all four wheels slip, [m/s^2].
double SlipLimit(const RobotConfig& config) { return config.wheel_friction * kGravity; }

TEST(SkidSteeringTest, SpeedsUpAsFrictionAllowsAndThenHoldsItsSpeed) {
  for (const double target : {0.5, 1.0, 2.0, -2.0}) {
    const RobotConfig config;
    OpenField field(config);
    for (int i = 1; i <= 50; ++i) {
      field.Drive(target, 0.0);
      const double possible = SlipLimit(config) * kDt * i;
      // Four rounds leave some mm/s as the slip goes to its end; the step in which it ends is
      // shared.
      const double tolerance = possible < std::abs(target) - 0.1 ? 5e-3 : 0.05;
      EXPECT_NEAR(std::abs(field.body().vx), std::min(possible, std::abs(target)), tolerance);
    }
    EXPECT_NEAR(field.body().vx, target, 1e-6);
    const double time = 1.0, ramp = std::abs(target) / SlipLimit(config);
    // A step moves at the speed of its end: half a step too far while it speeds up.
    EXPECT_NEAR(std::abs(field.pose().p.x), std::abs(target) * (time - 0.5 * ramp + 0.5 * kDt),
                0.01 * std::abs(target));
    EXPECT_EQ(field.pose().p.y, 0.0) << "not a bit to the side";
    EXPECT_EQ(field.pose().yaw, 0.0);
  }
}

TEST(SkidSteeringTest, BrakesWithinTheDistanceThatFrictionOrControllerAllow) {
  for (const double limit : {2.0, 4.0, 20.0}) {
    for (const double speed : {0.5, 1.0, 2.0}) {
      RobotConfig config;
      config.linear_acceleration = limit;
      OpenField field(config);
      field.Drive(speed, 0.0, 100);
      const double start = field.pose().p.x;
      field.Drive(0.0, 0.0, 100);
      const double deceleration = std::min(limit, SlipLimit(config));
      // As it moves at the speed of a step's end it stops up to a step's way early.
      EXPECT_NEAR(field.pose().p.x - start,
                  speed * speed / (2.0 * deceleration) - 0.5 * kDt * speed, 0.3 * kDt * speed)
          << speed << " m/s, " << limit << " m/s^2";
      EXPECT_NEAR(field.speed(), 0.0, 1e-6);
    }
  }
}

TEST(SkidSteeringTest, TurnRateInPureRotationFollowsFromTheGeometry) {
  RobotConfig jackal;
  RobotConfig other = jackal;
  other.wheel_base = 0.4;
  other.track = 0.3;
  other.wheel_separation_multiplier = 2.0;
  other.wheel_friction = 0.9;
  for (const RobotConfig& config : {jackal, other}) {
    const double a = 0.5 * config.wheel_base, b = 0.5 * config.track;
    const double ratio = b * b * config.wheel_separation_multiplier / (a * a + b * b);
    for (const double rate : {0.1, 0.5, 1.57, 3.14, -3.14}) {
      OpenField field(config);
      field.Drive(0.0, rate, 150);
      // Slip of (a, b - B/2) per rad/s, 0.09 m/s and more, is rounded off at 1e-3 m/s: 1e-4 of it.
      // Other rates are the same but for scale.
      const double rounding = std::abs(rate) < 0.2 ? 1e-2 : 1e-3;
      EXPECT_NEAR(field.body().yaw_rate / rate, ratio, rounding * ratio) << rate;
      EXPECT_NEAR(base::Norm(field.pose().p), 0.0, 1e-4);
    }
  }
  EXPECT_NEAR(0.187795 * 0.187795 * 1.5 / (0.131 * 0.131 + 0.187795 * 0.187795), 1.009, 5e-4)
      << "the Jackal's multiplier makes up for its slip";
}

// The same velocities and poses as fine explicit integration, and half the error with half the
// step.
TEST(SkidSteeringTest, ConvergesToTheEquationsOfMotion) {
  double velocity_error[3] = {}, position_error[3] = {};
  constexpr int kRounds = 20, kCommands = 10;
  for (int level = 0; level < 3; ++level) {
    base::Random random(1);
    for (int round = 0; round < kRounds; ++round) {
      RobotConfig config;
      config.control_rate = 50.0 * (1 << level);
      OpenField field(config, 10 << level);
      Controller controller{config};
      State truth;
      for (int k = 0; k < kCommands; ++k) {
        const double v = random.Uniform(-1.0, 2.0), w = random.Uniform(-3.14, 3.14);
        field.Drive(v, w);
        Integrate(controller, v, w, 0.2, truth);
        const double c = std::cos(truth.yaw), s = std::sin(truth.yaw);
        velocity_error[level] += std::hypot(field.body().vx - (c * truth.ahead - s * truth.left),
                                            field.body().vy - (s * truth.ahead + c * truth.left)) /
                                 (kRounds * kCommands);
        position_error[level] +=
            base::Norm(field.pose().p - base::Vec2{truth.x, truth.y}) / (kRounds * kCommands);
      }
    }
  }
  EXPECT_LT(velocity_error[0], 0.03) << "[m/s], under commands that jump by up to 3 m/s";
  EXPECT_LT(position_error[0], 0.02) << "[m], over 2 s";
  for (int level = 0; level < 2; ++level) {
    EXPECT_NEAR(velocity_error[level] / velocity_error[level + 1], 2.0, 0.4);
    EXPECT_NEAR(position_error[level] / position_error[level + 1], 2.0, 0.4);
  }
}

TEST(SkidSteeringTest, TurnsAtSpeedSlipSidewaysAndNeverBeyondFriction) {
  const RobotConfig config;
  for (const double v : {0.5, 1.0, 1.5, 2.0}) {
    for (const double w : {0.5, 1.0, 2.0, 3.0}) {
      OpenField field(config);
      field.Drive(v, w, 400);
      const double speed = field.speed(), yaw_rate = field.body().yaw_rate;
      EXPECT_LE(speed * yaw_rate, SlipLimit(config) * 1.001) << "it must be held on its circle";
      // In a steady turn forces and torque balance in the frame of the wheels, which is half a step
      // behind. Over a step the velocity there turns by w dt, whose cosine is taken for 1.
      const double yaw = field.pose().yaw - 0.5 * kDt * yaw_rate;
      const double c = std::cos(yaw), s = std::sin(yaw);
      const State steady{.ahead = c * field.body().vx + s * field.body().vy,
                         .left = c * field.body().vy - s * field.body().vx,
                         .yaw_rate = yaw_rate};
      const double side = 0.5 * config.track * config.wheel_separation_multiplier * w;
      const State rest = Derivative(config, steady, v - side, v + side, 1e-3);
      const double tolerance = 0.5 * kDt * yaw_rate * yaw_rate * speed + 0.01;
      EXPECT_NEAR(rest.ahead, 0.0, tolerance) << v << " " << w;
      EXPECT_NEAR(rest.left, 0.0, tolerance) << v << " " << w;
      EXPECT_NEAR(rest.yaw_rate, 0.0, 0.1) << v << " " << w;
      EXPECT_LT(steady.left, 0.0) << "it drifts outwards";
    }
  }
}

double Energy(const RobotConfig& config, const BodyState& s) {
  return 0.5 *
         (config.mass * (s.vx * s.vx + s.vy * s.vy) + config.yaw_inertia * s.yaw_rate * s.yaw_rate);
}

TEST(SkidSteeringTest, StandingWheelsOnlyTakeEnergy) {
  base::Random random(2);
  for (const double dt : {0.001, 0.02, 0.1}) {
    const RobotConfig config;
    const SkidSteering skid_steering(config, dt);
    for (int round = 0; round < 300; ++round) {
      BodyVelocity v{static_cast<float>(random.Uniform(-3.0, 3.0)),
                     static_cast<float>(random.Uniform(-3.0, 3.0)),
                     static_cast<float>(random.Uniform(-8.0, 8.0))};
      const auto energy = [&] {
        return Energy(config, {.vx = v.ahead, .vy = v.left, .yaw_rate = v.yaw_rate});
      };
      for (int step = 0; step < 200; ++step) {
        const double before = energy();
        v = skid_steering.Step(v, v, {});
        ASSERT_LE(energy(), before * (1.0 + 1e-6));
      }
      if (dt >= 0.02) {
        EXPECT_LT(energy(), 1e-9) << "at rest within 4 s";
      }
    }
  }
}

TEST(SkidSteeringTest, EnergyNeverExceedsWhatTheWheelsCommand) {
  // Friction draws the body to the velocity V at which it dissipates least, and in the kinetic norm
  // never away from it: |v - V| cannot grow, so sqrt(energy) stays below that of V plus what was
  // there.
  base::Random random(3);
  const RobotConfig config;
  const SkidSteering skid_steering(config, kDt);
  for (int round = 0; round < 200; ++round) {
    const WheelSpeeds wheels =
        skid_steering.Wheels(random.Uniform(-1.0, 2.0), random.Uniform(-3.14, 3.14));
    BodyVelocity rest;
    for (int step = 0; step < 1000; ++step) rest = skid_steering.Step(rest, rest, wheels);
    BodyVelocity v{static_cast<float>(random.Uniform(-3.0, 3.0)),
                   static_cast<float>(random.Uniform(-3.0, 3.0)),
                   static_cast<float>(random.Uniform(-6.0, 6.0))};
    const auto distance = [&] {
      return std::sqrt(Energy(config, {.vx = v.ahead - rest.ahead,
                                       .vy = v.left - rest.left,
                                       .yaw_rate = v.yaw_rate - rest.yaw_rate}));
    };
    for (int step = 0; step < 100; ++step) {
      const double before = distance();
      v = skid_steering.Step(v, v, wheels);
      ASSERT_LE(distance(), before * 1.0001 + 1e-5) << "round " << round << " step " << step;
    }
  }
}

TEST(SkidSteeringTest, NoAccelerationBeyondFriction) {
  base::Random random(4);
  const RobotConfig config;
  OpenField field(config);
  double greatest = 0.0;
  for (int k = 0; k < 400; ++k) {
    const double v = random.Uniform(-1.0, 2.0), w = random.Uniform(-3.14, 3.14);
    for (int i = 0; i < 10; ++i) {
      const BodyState before = field.body();
      field.Drive(v, w);
      const double change = std::hypot(field.body().vx - before.vx, field.body().vy - before.vy);
      greatest = std::max(greatest, change / kDt);
    }
  }
  EXPECT_GT(greatest, 0.99 * SlipLimit(config));
  EXPECT_LT(greatest, 1.01 * SlipLimit(config));
}

}  // namespace
}  // namespace slalom::sim
