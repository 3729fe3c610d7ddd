#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "sim/mass_distribution.h"
#include "sim/skid_steering.h"
#include "tests/sim/reference_drive.h"

namespace slalom::sim {
namespace {

// The wheels' grip ahead has the longer arm, so it wins against the grip across: no slip ahead.
TEST(FrictionLawsTest, OnPyramidsItTurnsOnTheSpotWithoutSlipAhead) {
  const RobotConfig config = Centred(FrictionLaw::kPyramid);
  for (const double rate : {0.5, 1.57, -2.0}) {
    OpenField field(config);
    field.Drive(0.0, rate, 150);
    EXPECT_NEAR(field.body().yaw_rate / rate, config.wheel_separation_multiplier, 0.02) << rate;
  }
}

TEST(FrictionLawsTest, OnGazebosPyramidGripDependsOnTheAnglesOfTheWheels) {
  const RobotConfig config = Centred(FrictionLaw::kGazebo);
  const SkidSteering skid_steering(config, kDt);
  for (const double angle : {-1.5, -0.8, -0.2, 0.0, 0.3, 1.0, 1.57}) {
    std::array<float, 4> angles;
    angles.fill(static_cast<float>(angle));
    for (const float ahead : {1.0f, -1.0f}) {
      Velocity v{ahead, 0.0f, 0.0f};
      v = Step(skid_steering, v, v, {}, angles);
      // A wheel that slides towards where its axis points into the ground is pressed down less.
      const double mu = config.wheel_friction;
      const double grip = std::abs(std::cos(angle)) / (1.0 + mu * ahead * std::sin(angle));
      EXPECT_NEAR(v.ahead, ahead * (1.0 - mu * kGravity * grip * kDt), 2e-4) << angle;
    }
  }
}

TEST(FrictionLawsTest, WheelsTurnAsTheirSpeedsSayUpToHalfTurns) {
  const RobotConfig config = WithFriction(FrictionLaw::kGazebo);
  const SkidSteering skid_steering(config, kDt);
  base::Random random(5);
  SkidLanes lanes;
  skid_steering.Enter(lanes, 2);
  double left = 0.0, right = 0.0;
  for (int i = 0; i < 2000; ++i) {
    lanes.wheel_left[2] = static_cast<float>(random.Uniform(-3.0, 3.0));
    lanes.wheel_right[2] = static_cast<float>(random.Uniform(-3.0, 3.0));
    lanes.Step();
    left += kDt * lanes.wheel_left[2] / config.wheel_radius;
    right += kDt * lanes.wheel_right[2] / config.wheel_radius;
    for (int wheel = 0; wheel < 4; ++wheel) {
      const double angle = lanes.angles[wheel][2], expected = wheel % 2 == 0 ? left : right;
      EXPECT_LT(std::abs(angle), 1.5712);
      EXPECT_NEAR(std::sin(2.0 * (angle - expected)), 0.0, 2e-3);
      EXPECT_GT(std::cos(2.0 * (angle - expected)), 0.0) << "half turns, not quarters";
    }
  }
}

TEST(FrictionLawsTest, WheelsBeginAtAnglesOfTheSeed) {
  const RobotConfig config = WithFriction(FrictionLaw::kGazebo);
  const Scene scene(std::make_shared<const Course>());
  Robot robot(config, 10);
  const auto drive = [&](std::uint64_t seed) {
    robot.Reset({}, seed);
    for (int i = 0; i < 10; ++i) robot.Drive(1.0, 2.0, scene, 0.0);
    return robot.body();
  };
  const BodyState first = drive(1);
  EXPECT_EQ(drive(1), first);
  EXPECT_NE(drive(2), first);
}

/// Mean errors against fine explicit integration under commands that jump by up to 3 m/s.
struct Errors {
  double velocity = 0.0;  // [m/s]
  double position = 0.0;  // Over 2 s, [m].
};

// The same velocities and poses, and half the error with half the step.
TEST(FrictionLawsTest, ConvergeToTheEquationsOfMotion) {
  constexpr int kDrives = 5, kCommands = 10, kLevels = 3;
  for (const FrictionLaw law : kLaws) {
    Errors mean[kLevels];
    base::Random random(1);
    for (int drive = 0; drive < kDrives; ++drive) {
      RobotConfig configs[kLevels];
      std::vector<std::unique_ptr<OpenField>> fields;
      for (int level = 0; level < kLevels; ++level) {
        configs[level] = WithFriction(law);
        configs[level].control_rate = 50.0 * (1 << level);
        fields.push_back(std::make_unique<OpenField>(configs[level], 10 << level));
      }
      Controller controller{configs[0]};
      State truth;
      for (int k = 0; k < kCommands; ++k) {
        const double v = random.Uniform(-1.0, 2.0), w = random.Uniform(-3.14, 3.14);
        Integrate(controller, v, w, 0.2, truth);
        for (int level = 0; level < kLevels; ++level) {
          fields[level]->Drive(v, w);
          const State found = fields[level]->CentreSeenFrom(truth.yaw);
          mean[level].velocity += std::hypot(found.ahead - truth.ahead, found.left - truth.left) /
                                  (kDrives * kCommands);
          mean[level].position +=
              base::Norm(fields[level]->pose().p - base::Vec2{truth.x, truth.y}) /
              (kDrives * kCommands);
        }
      }
    }
    EXPECT_LT(mean[0].velocity, 0.03) << base::EnumName(law);
    EXPECT_LT(mean[0].position, 0.02) << base::EnumName(law);
    for (int level = 0; level + 1 < kLevels; ++level) {
      EXPECT_NEAR(mean[level].velocity / mean[level + 1].velocity, 2.0, 0.4) << base::EnumName(law);
      EXPECT_NEAR(mean[level].position / mean[level + 1].position, 2.0, 0.4) << base::EnumName(law);
    }
  }
}

TEST(FrictionLawsTest, ALaneDoesNotDependOnTheOthers) {
  base::Random random(8);
  for (int round = 0; round < 600; ++round) {
    const int kind = round % 4;  // Robots of one of three laws, or of any.
    const auto draw_law = [&] { return kLaws[kind < 3 ? kind : random.UniformInt(3)]; };
    SkidLanes all;
    const int from = (round / 4) % SkidLanes::kSize, to = (round / 32) % SkidLanes::kSize;
    SkidLanes one;
    for (int lane = 0; lane < SkidLanes::kSize; ++lane) {
      const auto draw = [&](double most) {
        return static_cast<float>(random.Uniform(-most, most));
      };
      RobotConfig config = WithFriction(draw_law());
      config.mass += random.Uniform(-2.0, 2.0);
      config.track += random.Uniform(-0.05, 0.05);
      config.wheel_friction += random.Uniform(-0.2, 0.2);
      config.wheel_radius += random.Uniform(-0.01, 0.01);
      const SkidSteering skid_steering(config, kDt);
      skid_steering.Enter(all, lane);
      if (lane == from) skid_steering.Enter(one, to);
      all.ahead[lane] = draw(2.0);
      all.left[lane] = draw(1.0);
      all.yaw_rate[lane] = draw(4.0);
      all.ahead_before[lane] = draw(2.0);
      all.yaw[lane] = draw(3.0);
      all.turn[lane] = draw(0.1);
      all.wheel_left[lane] = draw(2.0);
      all.wheel_right[lane] = draw(2.0);
      for (auto& angles : all.angles) angles[lane] = draw(1.57);
    }
    one.ahead[to] = all.ahead[from];
    one.left[to] = all.left[from];
    one.yaw_rate[to] = all.yaw_rate[from];
    one.ahead_before[to] = all.ahead_before[from];
    one.yaw[to] = all.yaw[from];
    one.turn[to] = all.turn[from];
    one.wheel_left[to] = all.wheel_left[from];
    one.wheel_right[to] = all.wheel_right[from];
    for (int wheel = 0; wheel < 4; ++wheel) one.angles[wheel][to] = all.angles[wheel][from];
    all.Step();
    one.Step();
    ASSERT_EQ(one.ahead[to], all.ahead[from]);
    ASSERT_EQ(one.left[to], all.left[from]);
    ASSERT_EQ(one.yaw_rate[to], all.yaw_rate[from]);
    ASSERT_EQ(one.vx[to], all.vx[from]);
    ASSERT_EQ(one.vy[to], all.vy[from]);
    for (int wheel = 0; wheel < 4; ++wheel) {
      if (all.laws[from] != static_cast<int>(FrictionLaw::kGazebo)) continue;
      ASSERT_EQ(one.angles[wheel][to], all.angles[wheel][from]);
    }
  }
}

TEST(FrictionLawsTest, BrakingLeansOnTheFrontAndTurningOnTheOutside) {
  // With a high centre of mass, braking at the limit of friction lifts the rear wheels: they then
  // hold nothing against sliding sideways, so a small turn grows.
  const auto spin_of = [](double height) {
    RobotConfig config = Centred();
    config.centre_of_mass_z = height;
    const SkidSteering skid_steering(config, kDt);
    Velocity v{2.0f, 0.0f, 0.2f};
    for (int step = 0; step < 10; ++step) v = Step(skid_steering, v, v, {});
    return v.yaw_rate;
  };
  EXPECT_GT(spin_of(0.26), 1.3f * spin_of(0.0));
}

TEST(MassDistributionTest, LoadsBalanceTheCentreOfMass) {
  RobotConfig config;
  config.sensor_mass = 1.1;
  const MassDistribution masses = DistributeMass(config);
  EXPECT_NEAR(masses.mass, 19.531, 1e-9);
  EXPECT_NEAR(masses.x, 0.0169, 1e-4) << "10.8 mm without the sensor";
  EXPECT_NEAR(masses.y, 0.0017, 1e-4);
  EXPECT_NEAR(masses.yaw_inertia, 0.554 + 18.431 * 1.1 / 19.531 * 0.10924 * 0.10924, 1e-4);
  const double a = 0.5 * config.wheel_base, b = 0.5 * config.track;
  const auto& [front_left, front_right, rear_left, rear_right] = masses.loads;
  EXPECT_NEAR(front_left + front_right + rear_left + rear_right, 1.0, 1e-12);
  EXPECT_NEAR(a * (front_left + front_right - rear_left - rear_right), masses.x, 1e-12);
  EXPECT_NEAR(b * (front_left + rear_left - front_right - rear_right), masses.y, 1e-12);
}

TEST(MassDistributionTest, AJackalIsTheSumOfItsParts) {
  // Chassis and four wheels of the robot's description (docs/original-system.md, section 1.1).
  const double chassis = 16.523, wheel = 0.477, mass = chassis + 4.0 * wheel;
  const RobotConfig config;
  const double x = chassis * 0.012 / mass, y = chassis * 0.002 / mass;
  EXPECT_NEAR(config.mass, mass, 1e-9);
  EXPECT_NEAR(config.centre_of_mass_x, x, 5e-6);
  EXPECT_NEAR(config.centre_of_mass_y, y, 5e-6);
  EXPECT_NEAR(config.centre_of_mass_z, (chassis * (0.0635 + 0.067) + 4.0 * wheel * 0.098) / mass,
              1e-4);
  const double to_wheels = 0.131 * 0.131 + 0.187795 * 0.187795 + x * x + y * y;
  const double to_chassis = (0.012 - x) * (0.012 - x) + (0.002 - y) * (0.002 - y);
  EXPECT_NEAR(config.yaw_inertia,
              0.4485 + chassis * to_chassis + 4.0 * (0.0013 + wheel * to_wheels), 1e-4);
}

TEST(MassDistributionTest, RefusesAWheelThatCarriesNothing) {
  RobotConfig config;
  CheckMassDistribution(config);
  config.centre_of_mass_x = 0.10;
  config.centre_of_mass_y = 0.05;
  try {
    CheckMassDistribution(config);
    FAIL();
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("centre_of_mass_x"));
    EXPECT_THAT(error.what(), testing::HasSubstr("(0.1 m, 0.05 m)"));
  }
  config.drive = DriveKind::kIdeal;
  CheckMassDistribution(config);
}

}  // namespace
}  // namespace slalom::sim
