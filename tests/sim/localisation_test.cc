#include "sim/localisation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <vector>

#include "base/config.h"
#include "sim/environments.h"

namespace slalom::sim {
namespace {

TEST(LocalisationTest, WithoutDriftTheBeliefIsTheTruth) {
  base::Random random(1);
  Localisation localisation({});
  const base::Pose2 X_WO{{2.0, -1.0}, 2.5};
  localisation.Reset(X_WO, 3);
  EXPECT_EQ(localisation.X_OR(), base::Pose2{});
  for (int i = 0; i < 50; ++i) {
    const base::Pose2 X_WR{{random.Uniform(-9.0, 9.0), random.Uniform(-9.0, 9.0)},
                           random.Uniform(-3.1, 3.1)};
    localisation.Advance(X_WR, 0.0);
    const base::Vec2 p_W{random.Uniform(-9.0, 9.0), random.Uniform(-9.0, 9.0)};
    const base::Vec2 back = base::Transform(X_WO, localisation.X_OR().p);
    EXPECT_NEAR(back.x, X_WR.p.x, 1e-12);
    EXPECT_NEAR(back.y, X_WR.p.y, 1e-12);
    EXPECT_NEAR(base::WrapAngle(localisation.X_OR().yaw + X_WO.yaw - X_WR.yaw), 0.0, 1e-12);
    EXPECT_EQ(localisation.InRobotFrame(p_W), base::InverseTransform(X_WR, p_W));
  }
}

// A robot that slides to the left and slips while its wheels roll: it believes in its heading and
// in its wheels.
TEST(LocalisationTest, FromWheelsSlipPutsThePositionWrong) {
  Localisation localisation({.from_wheels = true});
  localisation.Reset({{1.0, 2.0}, 0.5 * base::kPi}, 3);
  localisation.Advance({{0.9, 2.1}, 0.5 * base::kPi}, 0.2);
  EXPECT_NEAR(localisation.X_OR().p.x, 0.2, 1e-12);
  EXPECT_NEAR(localisation.X_OR().p.y, 0.0, 1e-12);
  // A quarter of a circle on the spot, which in truth wanders.
  localisation.Advance({{0.8, 2.2}, base::kPi}, 0.0);
  EXPECT_NEAR(localisation.X_OR().p.x, 0.2, 1e-12);
  EXPECT_NEAR(localisation.X_OR().yaw, 0.5 * base::kPi, 1e-12);
  // Along the chord of an arc.
  localisation.Advance({{0.8, 2.2}, base::WrapAngle(1.5 * base::kPi)}, 0.3);
  const double gone = 0.3 * std::sqrt(0.5);
  EXPECT_NEAR(localisation.X_OR().p.x, 0.2 - gone, 1e-12);
  EXPECT_NEAR(localisation.X_OR().p.y, gone, 1e-12);
  EXPECT_NEAR(localisation.InRobotFrame({1.0, 2.0}).x, 0.2 - gone, 1e-12);
}

/// Sample variances of the belief's error after a drive of `distance` ahead and a turn of `turn`.
struct Variances {
  double ahead = 0.0, left = 0.0, heading = 0.0;
};

constexpr int kDrives = 4000;
// A sample variance of n normal numbers is within 5 sqrt(2 / n) of the true one, for one seed in a
// million not.
const double kWithin = 5.0 * std::sqrt(2.0 / kDrives);

Variances Drive(const LocalisationConfig& config, double distance, double turn, int num_steps) {
  Variances variances;
  for (int drive = 0; drive < kDrives; ++drive) {
    Localisation localisation(config);
    localisation.Reset({}, base::DeriveSeed(4, "test", {static_cast<std::uint64_t>(drive)}));
    for (int step = 1; step <= num_steps; ++step) {
      const double done = static_cast<double>(step) / num_steps;
      localisation.Advance({{distance * done, 0.0}, base::WrapAngle(turn * done)}, 0.0);
    }
    const base::Pose2 error{localisation.X_OR().p - base::Vec2{distance, 0.0},
                            base::WrapAngle(localisation.X_OR().yaw - turn)};
    variances.ahead += error.p.x * error.p.x / kDrives;
    variances.left += error.p.y * error.p.y / kDrives;
    variances.heading += error.yaw * error.yaw / kDrives;
  }
  return variances;
}

TEST(LocalisationTest, PositionWalksAsFarForAnyLengthOfStep) {
  for (const int num_steps : {5, 50}) {
    const Variances found = Drive({.position_drift = 0.1}, 4.0, 0.0, num_steps);
    EXPECT_NEAR(found.ahead, 0.01 * 4.0, kWithin * 0.04);
    EXPECT_NEAR(found.left, 0.01 * 4.0, kWithin * 0.04);
    EXPECT_EQ(found.heading, 0.0);
  }
}

TEST(LocalisationTest, HeadingWalksWithDistanceAndTurnsAndCarriesThePositionOff) {
  const double per_metre = 0.02, per_radian = 0.03;
  const Variances found =
      Drive({.heading_drift = per_metre, .turn_drift = per_radian}, 6.0, 0.0, 60);
  EXPECT_NEAR(found.heading, per_metre * per_metre * 6.0, kWithin * found.heading);
  // The integral of a random walk of n steps of length d: h^2 d^3 (n - 1) n (2 n - 1) / 6.
  const double left = per_metre * per_metre * 0.001 * 59.0 * 60.0 * 119.0 / 6.0;
  EXPECT_NEAR(found.left, left, kWithin * left);
  const Variances turned = Drive({.turn_drift = per_radian}, 0.0, 3.0, 10);
  EXPECT_NEAR(turned.heading, per_radian * per_radian * 3.0, kWithin * turned.heading);
  EXPECT_EQ(turned.ahead, 0.0);
}

EnvironmentConfig Drifting() {
  EnvironmentConfig config;
  config.localisation = {.position_drift = 0.3, .heading_drift = 0.1, .turn_drift = 0.1};
  return config;
}

TEST(LocalisationTest, OdometryAndGoalShareOneBeliefAndSuccessIsTrue) {
  Course course;
  course.start = {{1.0, 2.0}, 0.7};
  course.goal_W = base::Transform(course.start, {3.0, 0.0});
  const auto scene = MakeScene(std::make_shared<const Course>(course));
  const EnvironmentConfig config = Drifting();
  CourseEnvironments environments(config, {scene}, 1, nullptr);
  std::vector<env::StepResult> results(1);
  int num_apart = 0;
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    environments.Reset(0, {0, seed});
    results[0] = {};
    double true_distance = 3.0;
    for (int step = 0; step < 30 && !results[0].ended(); ++step) {
      environments.Step(env::NumbersOf(std::vector{config.action.Normalise(1.0, 0.0)}), results);
      const auto& observations = environments.observations();
      const auto state = observations.frame(0).state;
      const base::Vec2 goal_O =
          base::Transform(observations.odometry[0].X_OR, base::Vec2{state[0], state[1]});
      EXPECT_NEAR(goal_O.x, 3.0, 1e-5) << "the goal stays where it is in O";
      EXPECT_NEAR(goal_O.y, 0.0, 1e-5);
      const double believed = base::Norm({state[0], state[1]});
      const double distance = base::Norm(course.goal_W - environments.robot_pose(0).p);
      EXPECT_EQ(results[0].outcome == env::Outcome::kSuccess, distance < 0.4);
      num_apart += results[0].ended() && believed > 0.5;
      EXPECT_NEAR(results[0].reward, true_distance - distance + (results[0].ended() ? 20.0 : 0.0),
                  1e-5);
      true_distance = distance;
    }
  }
  EXPECT_GT(num_apart, 5) << "the belief was elsewhere";
}

struct Task {
  EnvironmentConfig environment;
  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("environment", environment, "");
  }
};

TEST(LocalisationTest, TheRealRobotProfileLiesOverAnyTask) {
  const Task task =
      config::Load<Task>(std::filesystem::path(SLALOM_SOURCE_DIR) / "configs/real-robot.toml", {});
  const EnvironmentConfig& config = task.environment;
  CheckConsistent(config);
  EXPECT_EQ(config.lidar.offset_x, -0.065);
  EXPECT_GT(config.lidar.dropout_probability, 0.0);
  EXPECT_GT(config.robot.command_jitter, 0.0);
  EXPECT_NE(config.robot.wheel_imbalance, 0.0);
  EXPECT_EQ(MakeObservationSpec(config), env::ObservationSpec{}) << "policies may be run with it";
  // What it says of the drift: 1 % of the way after 40 m of gentle bends.
  const Variances drift = Drive(config.localisation, 40.5, 0.0, 200);
  const double error = std::sqrt(drift.ahead + drift.left);
  EXPECT_GT(error, 0.25);
  EXPECT_LT(error, 0.75);
}

}  // namespace
}  // namespace slalom::sim
