// What every engine must do, whatever its friction: the contract of sim::RobotBody.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "base/random.h"
#include "sim/courses/motion.h"
#include "sim/environments.h"
#include "sim/randomized_config.h"
#include "tests/sim/engines/engine_drive.h"

namespace slalom::test {
namespace {

class EngineBodyTest : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (const std::string reason = ReasonToSkip(GetParam()); !reason.empty()) {
      GTEST_SKIP() << reason;
    }
  }
};

sim::Course WithCircle(base::Vec2 p, double radius) {
  sim::Course course;
  course.circles = {{p, radius}};
  return course;
}

sim::EnvironmentConfig FineSteps() {
  sim::EnvironmentConfig config;
  config.episode.step = 0.02;
  return config;
}

TEST_P(EngineBodyTest, StandsWhereItIsPut) {
  EngineDrive robot(GetParam());
  for (const base::Pose2& start :
       {base::Pose2{{1.0, -2.0}, 0.7}, base::Pose2{{-30.0, 5.0}, -3.0}}) {
    robot.Reset(start);
    EXPECT_NEAR(robot.pose().p.x, start.p.x, 1e-5);
    EXPECT_NEAR(robot.pose().p.y, start.p.y, 1e-5);
    EXPECT_NEAR(robot.pose().yaw, start.yaw, 1e-5);
    EXPECT_FALSE(robot.Drive(0.0, 0.0, 10));
    // Contacts that give way let it creep; 2 s at less than 0.5 mm/s.
    EXPECT_NEAR(base::Norm(robot.pose().p - start.p), 0.0, 1e-3);
    EXPECT_NEAR(robot.pose().yaw, start.yaw, 1e-3);
  }
}

TEST_P(EngineBodyTest, GoesAheadAndBackAtTheSpeedAsked) {
  EngineDrive robot(GetParam());
  for (const double speed : {1.0, -0.5}) {
    robot.Reset({});
    robot.Drive(speed, 0.0, 5);
    const double x = robot.pose().p.x;
    robot.Drive(speed, 0.0, 5);
    EXPECT_NEAR(robot.pose().p.x - x, speed, 0.01 * std::abs(speed));
    EXPECT_NEAR(robot.pose().p.y, 0.0, 0.03);
    EXPECT_NEAR(robot.speed_ahead(), speed, 0.02);
  }
}

// At friction x g, or by ODE's pyramid, whose axes turn with the wheels, at 2 / pi of that.
TEST_P(EngineBodyTest, SpeedsUpAsItsWheelsGrip) {
  for (const double friction : {0.5, 0.25}) {
    sim::EnvironmentConfig config = FineSteps();
    config.robot.wheel_friction = friction;
    EngineDrive robot(GetParam(), config);
    while (robot.speed_ahead() < 1.5 && robot.time() < 3.0) robot.Drive(2.0, 0.0);
    const double fastest = 1.5 / (friction * 9.8);
    EXPECT_GT(robot.time(), 0.95 * fastest) << friction;
    EXPECT_LT(robot.time(), 1.1 * fastest * 0.5 * base::kPi) << friction;
  }
}

// The drive's controller is Slalom's own: a command acts after its delay, within its limits.
TEST_P(EngineBodyTest, TakesCommandsAsSlalomDoes) {
  sim::EnvironmentConfig config;
  config.robot.command_delay = 0.2;
  config.robot.linear_speed_limit = 0.6;
  EngineDrive robot(GetParam(), config);
  robot.Drive(2.0, 0.0, 1);
  EXPECT_NEAR(robot.pose().p.x, 0.0, 1e-3);
  robot.Drive(2.0, 0.0, 5);
  EXPECT_NEAR(robot.speed_ahead(), 0.6, 0.02);
  robot.Drive(0.0, 0.0, 1);
  EXPECT_NEAR(robot.speed_ahead(), 0.6, 0.02);
}

// As configs of before wheel_width have it.
TEST_P(EngineBodyTest, GoesOnWheelsWithoutWidth) {
  sim::EnvironmentConfig config;
  config.robot.wheel_width = 0.0;
  config.robot.centre_of_mass_x = config.robot.centre_of_mass_y = 0.0;
  config.robot.centre_of_mass_z = 0.0;
  EngineDrive robot(GetParam(), config);
  robot.Drive(1.0, 0.0, 10);
  EXPECT_NEAR(robot.speed_ahead(), 1.0, 0.02);
}

TEST_P(EngineBodyTest, RightWheelsThatRunFasterTurnItLeft) {
  sim::EnvironmentConfig config;
  config.robot.wheel_imbalance = 0.1;
  EngineDrive robot(GetParam(), config);
  robot.Drive(1.0, 0.0, 10);
  EXPECT_GT(robot.pose().yaw, 0.1);
}

// The chassis ends 0.21 m ahead and 0.155 m out, the wheels beside it 0.229 m ahead and 0.208 m
// out.
TEST_P(EngineBodyTest, TouchesACylinderWhenItGetsThere) {
  for (const auto& [y, front] : {std::pair{0.0, 0.21}, {0.19, 0.229}, {-0.19, 0.229}}) {
    EngineDrive robot(GetParam(), FineSteps(), WithCircle({1.0, y}, 0.075));
    while (robot.pose().p.x < 1.2) {
      if (robot.Drive(0.4, 0.0)) break;
    }
    // Within a control step, of 8 mm.
    EXPECT_NEAR(robot.pose().p.x, 1.0 - 0.075 - front + 0.004, 0.006) << y;
  }
}

TEST_P(EngineBodyTest, PassesWhatIsNotInItsWay) {
  EXPECT_FALSE(EngineDrive(GetParam(), {}, WithCircle({1.0, 0.30}, 0.075)).Drive(1.0, 0.0, 10));
  EXPECT_TRUE(EngineDrive(GetParam(), {}, WithCircle({1.0, 0.27}, 0.075)).Drive(1.0, 0.0, 10));
}

TEST_P(EngineBodyTest, TouchesABoxAndIsHeldByIt) {
  sim::Course course;
  course.boxes = {{{{1.0, 0.0}, 0.3}, {0.05, 2.0}}};
  EngineDrive robot(GetParam(), FineSteps(), course);
  bool touched = false;
  for (int i = 0; i < 100; ++i) touched = robot.Drive(0.5, 0.0) || touched;
  EXPECT_TRUE(touched);
  // Its near face crosses y = 0 at 1 - 0.05 / cos(0.3) = 0.948, and the left wheel is nearer to it.
  EXPECT_LT(robot.pose().p.x, 0.948 - 0.2);
}

TEST_P(EngineBodyTest, AnotherOutlineIsABox) {
  sim::EnvironmentConfig config = FineSteps();
  config.robot.length = 0.6;
  config.robot.width = 0.5;
  EngineDrive robot(GetParam(), config, WithCircle({1.0, 0.0}, 0.075));
  while (robot.pose().p.x < 1.2) {
    if (robot.Drive(0.5, 0.0)) break;
  }
  EXPECT_NEAR(robot.pose().p.x, 1.0 - 0.075 - 0.3, 0.012);
}

TEST_P(EngineBodyTest, IsHitByWhatMovesAndPushedAlong) {
  // From x = -2 to 2 in 4 s: 1 m/s on average, from a slow beginning.
  sim::Course course;
  course.moving = {{.radius = 0.0,
                    .half_size = {0.2, 0.3},
                    .key_frames = {{0.0, {{-2.0, 0.0}, 0.0}}, {4.0, {{2.0, 0.0}, 0.0}}}}};
  const sim::Motion motion(course.moving[0]);
  EngineDrive robot(GetParam(), FineSteps(), course);
  while (robot.time() < 3.5) {
    if (robot.Drive(0.0, 0.0)) break;
  }
  EXPECT_NEAR(motion.At(robot.time()).X_WB.p.x + 0.2, -0.229, 0.03);
  while (robot.time() < 3.5) robot.Drive(0.0, 0.0);
  EXPECT_NEAR(motion.At(robot.time()).X_WB.p.x + 0.2, robot.pose().p.x - 0.229, 0.05);
}

// Its friction turns with the wheels, so where they begin matters, and the seed says it.
TEST(OdeBodyTest, GripsByTheAnglesOfItsWheels) {
  if (const std::string reason = ReasonToSkip("ode"); !reason.empty()) GTEST_SKIP() << reason;
  EngineDrive one("ode"), other("ode");
  one.Reset({}, 1);
  other.Reset({}, 2);
  one.Drive(1.0, 0.0);
  other.Drive(1.0, 0.0);
  EXPECT_GT(std::abs(one.pose().p.x - other.pose().p.x), 1e-3);
}

// MuJoCo knows no speed of what it is not free to move, so there obstacles only push.
TEST(OdeBodyTest, IsDraggedAlongByWhatMovesAcross) {
  if (const std::string reason = ReasonToSkip("ode"); !reason.empty()) GTEST_SKIP() << reason;
  // Comes from the robot's right, 0.5 m ahead for each metre to the left.
  sim::Course course;
  course.moving = {{.radius = 0.0,
                    .half_size = {1.0, 0.1},
                    .key_frames = {{0.0, {{-0.5, -1.0}, 0.0}}, {2.0, {{0.5, 1.0}, 0.0}}}}};
  EngineDrive robot("ode", FineSteps(), course);
  while (robot.time() < 1.8) robot.Drive(0.0, 0.0);
  EXPECT_GT(robot.pose().p.y, 0.5);
  EXPECT_GT(robot.pose().p.x, 0.03);
}

TEST_P(EngineBodyTest, IsHitByAMovingCylinder) {
  sim::Course course;
  course.moving = {{.radius = 0.1,
                    .half_size = {},
                    .key_frames = {{0.0, {{0.0, -3.0}, 0.0}}, {3.0, {{0.0, 3.0}, 0.0}}}}};
  EXPECT_TRUE(EngineDrive(GetParam(), {}, course).Drive(0.0, 0.0, 15));
  course.moving[0].key_frames = {{0.0, {{0.4, -3.0}, 0.0}}, {3.0, {{0.4, 3.0}, 0.0}}};
  EXPECT_FALSE(EngineDrive(GetParam(), {}, course).Drive(0.0, 0.0, 15));
}

/// States along a drive with random commands among cylinders, some of which it runs into.
std::vector<sim::BodyState> RandomDrive(EngineDrive& robot, std::uint64_t seed) {
  base::Random random(seed);
  robot.Reset({{0.0, 0.0}, static_cast<double>(seed)});
  std::vector<sim::BodyState> states;
  for (int i = 0; i < 12; ++i) {
    robot.Drive(random.Uniform(-1.0, 2.0), random.Uniform(-3.14, 3.14));
    states.push_back(robot.body());
  }
  return states;
}

TEST_P(EngineBodyTest, DrivesAlikeAgainAndOnAnyNumberOfThreads) {
  constexpr int kNum = 4;
  sim::Course course;
  for (int i = 0; i < 8; ++i) {
    const auto [s, c] = base::SinCos(0.785 * i);
    course.circles.push_back({{0.6 * c, 0.6 * s}, 0.1});
  }
  std::vector<std::vector<sim::BodyState>> alone(kNum), together(kNum);
  EngineDrive one(GetParam(), {}, course);
  for (int i = 0; i < kNum; ++i) alone[i] = RandomDrive(one, i);
  std::vector<std::unique_ptr<EngineDrive>> robots;
  for (int i = 0; i < kNum; ++i) {
    robots.push_back(std::make_unique<EngineDrive>(GetParam(), sim::EnvironmentConfig{}, course));
  }
  base::ParallelFor parallel(kNum);
  parallel.For(kNum, [&](int i) { together[i] = RandomDrive(*robots[i], i); });
  EXPECT_EQ(alone, together);
}

/// The poses of an episode of steady driving.
std::vector<base::Pose2> PosesOf(const sim::EnvironmentConfig& config, const std::string& physics,
                                 std::uint64_t seed) {
  sim::Course course = WithCircle({3.0, 0.3}, 0.2);
  course.goal_W = {9.0, 0.0};
  sim::CourseSet set;
  set.courses = {std::make_shared<const sim::Course>(std::move(course))};
  sim::CourseEnvironments environments(config, sim::MakeScenes(set), 1, nullptr,
                                       engines::FindPhysics(physics).make_bodies);
  environments.Reset(0, {0, seed});
  std::vector<base::Pose2> poses;
  std::vector<env::StepResult> results(1);
  for (int i = 0; i < 12 && !results[0].ended(); ++i) {
    environments.Step(env::NumbersOf(std::vector{env::Action{0.4f, i % 2 == 0 ? 0.5f : -0.5f}}),
                      results);
    poses.push_back(environments.robot_pose(0));
  }
  return poses;
}

TEST_P(EngineBodyTest, ARandomisedEpisodeIsThatOfAConfigWithTheDrawnValues) {
  sim::EnvironmentConfig config;
  config.randomize = {{"robot.command_delay", {"[0.0, 0.3]", ""}},
                      {"robot.mass", {"[12.0, 25.0]", ""}},
                      {"robot.wheel_friction", {"[0.3, 0.7]", ""}}};
  sim::RandomizedConfig task(config);
  for (const std::uint64_t seed : {1u, 2u}) {
    task.Draw(seed);
    EXPECT_EQ(PosesOf(config, GetParam(), seed), PosesOf(task.config(), GetParam(), seed));
  }
  EXPECT_NE(PosesOf(config, GetParam(), 1), PosesOf(config, GetParam(), 2));
}

TEST_P(EngineBodyTest, RobotsThatItCannotBuildAreRefusedBeforeTheyAreDrawn) {
  sim::EnvironmentConfig config;
  const auto error_of = [&] {
    try {
      PosesOf(config, GetParam(), 1);
      return std::string();
    } catch (const base::Error& error) {
      return std::string(error.what());
    }
  };
  config.randomize = {{"robot.drive", {"['skid-steer', 'ideal']", ""}}};
  EXPECT_THAT(error_of(), ::testing::HasSubstr("environment.robot.drive is \"ideal\""));
  config.randomize = {{"robot.mass", {"[1.0, 20.0]", ""}}};
  EXPECT_THAT(error_of(), ::testing::HasSubstr("environment.robot.mass is 1 kg"));
}

INSTANTIATE_TEST_SUITE_P(Each, EngineBodyTest, ::testing::Values("ode", "mujoco"),
                         [](const auto& test) { return std::string(test.param); });

}  // namespace
}  // namespace slalom::test
