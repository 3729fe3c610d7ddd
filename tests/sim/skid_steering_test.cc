#include "sim/skid_steering.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "tests/sim/reference_drive.h"

namespace slalom::sim {
namespace {

TEST(SkidSteeringTest, SpeedsUpAsFrictionAllowsAndThenHoldsItsSpeed) {
  for (const double target : {0.5, 1.0, 2.0, -2.0}) {
    const RobotConfig config = Centred();
    OpenField field(config);
    for (int i = 1; i <= 50; ++i) {
      field.Drive(target, 0.0);
      const double possible = SlipLimit(config) * kDt * i;
      // The rounds leave some mm/s as the slip goes to its end; the step in which it ends is
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
  const RobotConfig jackal = Centred();
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
}

TEST(SkidSteeringTest, TurnsAtSpeedSlipSidewaysAndNeverBeyondFriction) {
  const RobotConfig config = Centred();
  for (const double v : {0.5, 1.0, 1.5, 2.0}) {
    for (const double w : {0.5, 1.0, 2.0, 3.0}) {
      OpenField field(config);
      field.Drive(v, w, 400);
      const double speed = field.speed(), yaw_rate = field.body().yaw_rate;
      EXPECT_LE(speed * yaw_rate, SlipLimit(config) * 1.001) << "it must be held on its circle";
      // In a steady turn forces and torque balance in the frame of the wheels, which is half a step
      // behind. Over a step the velocity there turns by w dt, whose cosine is taken for 1.
      const double yaw = field.pose().yaw - 0.5 * kDt * yaw_rate;
      const State steady = field.CentreSeenFrom(yaw);
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
  for (const FrictionLaw law : kLaws) {
    for (const double dt : {0.001, 0.02, 0.1}) {
      const RobotConfig config = WithFriction(law);
      const SkidSteering skid_steering(config, dt);
      for (int round = 0; round < 300; ++round) {
        Velocity v{static_cast<float>(random.Uniform(-3.0, 3.0)),
                   static_cast<float>(random.Uniform(-3.0, 3.0)),
                   static_cast<float>(random.Uniform(-8.0, 8.0))};
        std::array<float, 4> angles;
        for (float& angle : angles) angle = static_cast<float>(random.Uniform(-1.57, 1.57));
        const auto energy = [&] {
          return Energy(config, {.vx = v.ahead, .vy = v.left, .yaw_rate = v.yaw_rate});
        };
        for (int step = 0; step < 200; ++step) {
          const double before = energy();
          // Wherever the search begins.
          const Velocity near{static_cast<float>(random.Uniform(-3.0, 3.0)), v.left, v.yaw_rate};
          v = Step(skid_steering, v, round % 2 == 0 ? v : near, {}, angles);
          ASSERT_LE(energy(), before * (1.0 + 1e-6) + 1e-30) << base::EnumName(law);
        }
        if (dt >= 0.02 && law != FrictionLaw::kGazebo) {
          EXPECT_LT(energy(), 1e-9) << "at rest within 4 s";
        }
      }
    }
  }
}

TEST(SkidSteeringTest, EnergyNeverExceedsWhatTheWheelsCommand) {
  // Friction draws the body to the velocity V at which it dissipates least, and in the kinetic norm
  // never away from it: |v - V| cannot grow, so sqrt(energy) stays below that of V plus what was
  // there.
  base::Random random(3);
  for (const FrictionLaw law : {FrictionLaw::kCone, FrictionLaw::kPyramid}) {
    RobotConfig config = WithFriction(law);
    config.centre_of_mass_z = 0.0;  // With loads that do not change.
    const SkidSteering skid_steering(config, kDt);
    for (int round = 0; round < 200; ++round) {
      const WheelSpeeds wheels =
          skid_steering.Wheels(random.Uniform(-1.0, 2.0), random.Uniform(-3.14, 3.14));
      Velocity rest;
      for (int step = 0; step < 1000; ++step) rest = Step(skid_steering, rest, rest, wheels);
      Velocity v{static_cast<float>(random.Uniform(-3.0, 3.0)),
                 static_cast<float>(random.Uniform(-3.0, 3.0)),
                 static_cast<float>(random.Uniform(-6.0, 6.0))};
      const auto distance = [&] {
        return std::sqrt(Energy(config, {.vx = v.ahead - rest.ahead,
                                         .vy = v.left - rest.left,
                                         .yaw_rate = v.yaw_rate - rest.yaw_rate}));
      };
      for (int step = 0; step < 100; ++step) {
        const double before = distance();
        v = Step(skid_steering, v, v, wheels);
        ASSERT_LE(distance(), before * 1.0001 + 1e-5)
            << base::EnumName(law) << " round " << round << " step " << step;
      }
    }
  }
}

TEST(SkidSteeringTest, NoAccelerationBeyondFriction) {
  for (const double wheel_friction : {0.5, 2.0}) {  // With the second, wheels would lift.
    base::Random random(4);
    RobotConfig config;
    config.wheel_friction = wheel_friction;
    OpenField field(config);
    double greatest = 0.0;
    for (int k = 0; k < 400; ++k) {
      const double v = random.Uniform(-1.0, 2.0), w = random.Uniform(-3.14, 3.14);
      for (int i = 0; i < 10; ++i) {
        const State before = field.CentreSeenFrom(0.0);
        field.Drive(v, w);
        const State after = field.CentreSeenFrom(0.0);
        const double change = std::hypot(after.ahead - before.ahead, after.left - before.left);
        greatest = std::max(greatest, change / kDt);
      }
    }
    EXPECT_GT(greatest, 0.95 * SlipLimit(config));
    EXPECT_LT(greatest, 1.01 * SlipLimit(config));
  }
}

}  // namespace
}  // namespace slalom::sim
