// Slalom's drive beside the engines', live: the same commands to both, on open ground.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "base/random.h"
#include "tests/sim/engines/engine_drive.h"

namespace slalom::test {
namespace {

/// A physics and how far Slalom may be from it, on average.
struct Tolerance {
  const char* physics;
  sim::FrictionLaw friction;  // Of Slalom's drive.
  double distance;            // After 2 s of random commands, [m].
  double heading;             // [rad]
  double turn_gain;           // Of steady turns: turn rate / commanded turn rate.
};

void PrintTo(const Tolerance& tolerance, std::ostream* out) { *out << tolerance.physics; }

class DriveComparisonTest : public ::testing::TestWithParam<Tolerance> {
 protected:
  void SetUp() override {
    if (const std::string reason = ReasonToSkip(GetParam().physics); !reason.empty()) {
      GTEST_SKIP() << reason;
    }
  }
};

TEST_P(DriveComparisonTest, RandomCommandsEndNearby) {
  constexpr int kNum = 150;
  sim::EnvironmentConfig config;
  config.robot.friction = GetParam().friction;
  EngineDrive ours("slalom", config), theirs(GetParam().physics, config);
  base::Random random(7);
  double distance = 0.0, heading = 0.0;
  for (int k = 0; k < kNum; ++k) {
    ours.Reset({}, k);
    theirs.Reset({}, k);
    for (int step = 0; step < 10; ++step) {
      const double linear = random.Uniform(0.0, 2.0), angular = random.Uniform(-3.14, 3.14);
      ours.Drive(linear, angular);
      theirs.Drive(linear, angular);
    }
    distance += base::Norm(ours.pose().p - theirs.pose().p) / kNum;
    heading += std::abs(base::WrapAngle(ours.pose().yaw - theirs.pose().yaw)) / kNum;
  }
  std::printf("%s: %.3f m, %.3f rad after 2 s\n", GetParam().physics, distance, heading);
  EXPECT_LT(distance, GetParam().distance);
  EXPECT_LT(heading, GetParam().heading);
}

TEST_P(DriveComparisonTest, SteadyTurnsAreAlike) {
  sim::EnvironmentConfig config;
  config.robot.friction = GetParam().friction;
  double difference = 0.0;
  int num = 0;
  for (const double linear : {0.0, 0.5, 1.0, 1.5}) {
    for (const double angular : {0.5, 1.0}) {
      double gain[2];
      const char* const names[2] = {"slalom", GetParam().physics};
      for (int k = 0; k < 2; ++k) {
        EngineDrive robot(names[k], config);
        robot.Drive(linear, angular, 10);
        const double yaw = robot.pose().yaw;
        robot.Drive(linear, angular, 5);
        gain[k] = base::WrapAngle(robot.pose().yaw - yaw) / angular;
      }
      std::printf("%s: %.1f m/s, %.1f rad/s: gain %.3f, Slalom's %.3f\n", GetParam().physics,
                  linear, angular, gain[1], gain[0]);
      difference += std::abs(gain[0] - gain[1]);
      ++num;
    }
  }
  EXPECT_LT(difference / num, GetParam().turn_gain);
}

INSTANTIATE_TEST_SUITE_P(
    Each, DriveComparisonTest,
    ::testing::Values(Tolerance{"ode", sim::FrictionLaw::kGazebo, 0.06, 0.07, 0.05},
                      Tolerance{"mujoco", sim::FrictionLaw::kCone, 0.055, 0.06, 0.09}),
    [](const auto& test) { return std::string(test.param.physics); });

}  // namespace
}  // namespace slalom::test
