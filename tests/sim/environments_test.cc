#include "sim/environments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "base/config.h"
#include "base/error.h"
#include "tests/support/moving_courses.h"
#include "tests/support/random_courses.h"

namespace slalom::sim {
namespace {

using env::Outcome;

/// Start at the origin heading along +x, goal `goal_x` ahead, a wall across `wall_x`.
std::shared_ptr<const Scene> Corridor(double goal_x, double wall_x) {
  Course course;
  course.name = "corridor";
  course.goal_W = {goal_x, 0.0};
  course.boxes = {{{{wall_x + 0.05, 0.0}, 0.0}, {0.05, 5.0}}};
  return MakeScene(std::make_shared<const Course>(course));
}

/// One environment with instant drive, whose agent speaks in [m/s] and [rad/s].
class One {
 public:
  One(EnvironmentConfig config, std::shared_ptr<const Scene> scene)
      : environments_(config, {std::move(scene)}, 1, nullptr) {
    environments_.Reset(0, {});
  }
  env::StepResult Step(double linear, double angular = 0.0) {
    const std::vector<env::Action> actions{
        environments_.config().action.Normalise(linear, angular)};
    environments_.Step(env::NumbersOf(actions), results_);
    return results_[0];
  }
  CourseEnvironments& environments() { return environments_; }
  env::FrameView frame() const { return environments_.observations().frame(0); }
  double x() const { return environments_.robot_pose(0).p.x; }

 private:
  CourseEnvironments environments_;
  std::vector<env::StepResult> results_{1};
};

EnvironmentConfig InstantDrive() {
  EnvironmentConfig config;
  config.robot.drive = DriveKind::kIdeal;
  config.robot.linear_acceleration = 1000.0;
  config.robot.angular_acceleration = 1000.0;
  return config;
}

TEST(EnvironmentConfigTest, DefaultsAreTheOriginalsNumbers) {
  const EnvironmentConfig config;
  CheckConsistent(config);
  EXPECT_EQ(NumSubsteps(config), 10);
  EXPECT_EQ(MakeObservationSpec(config), env::ObservationSpec{});
  EXPECT_EQ(MakeObservationSpec(config).size(), 724);
  EXPECT_NEAR(config.robot.mass, 18.431, 1e-9);
  EXPECT_NEAR(Lidar(config.lidar, 5.0).beam_angle(0), -2.35619, 1e-5);
  EXPECT_NEAR(Lidar(config.lidar, 5.0).beam_angle(719), 2.35619, 1e-5);
}

TEST(EnvironmentConfigTest, IsReadAndPrintedByConfig) {
  const std::string text = config::ToToml(EnvironmentConfig{});
  EXPECT_EQ(config::ToToml(config::FromToml<EnvironmentConfig>(text, "test")), text);
  EXPECT_EQ(config::FromToml<EnvironmentConfig>("robot.yaw_gain = 0.8", "test").robot.yaw_gain,
            0.8);
  EXPECT_THROW(config::FromToml<EnvironmentConfig>("robot.yaw_gain = -1", "test"), base::Error);
}

TEST(EnvironmentConfigTest, RefusesWhatContradictsItself) {
  EnvironmentConfig odd_step;
  odd_step.episode.step = 0.21;
  EnvironmentConfig short_sight;
  short_sight.lidar.max_range = 0.1;
  EnvironmentConfig short_clip;
  short_clip.observation.range_clip = 0.5;
  short_clip.lidar.min_range = 0.6;
  EnvironmentConfig falls_over;
  falls_over.robot.sensor_mass = 100.0;
  falls_over.robot.sensor_x = 0.3;
  EnvironmentConfig wide_wheels;
  wide_wheels.robot.wheel_width = 0.4;
  EnvironmentConfig jammed;
  jammed.robot.friction = FrictionLaw::kGazebo;
  jammed.robot.wheel_friction = 1.0;
  for (const EnvironmentConfig& config :
       {odd_step, short_sight, short_clip, falls_over, wide_wheels, jammed}) {
    EXPECT_THROW(CheckConsistent(config), base::Error);
    EXPECT_THROW(CourseEnvironments(config, {Corridor(3.0, 9.0)}, 1, nullptr), base::Error);
  }
}

TEST(EnvironmentsTest, FirstFrameIsTakenAtRest) {
  One one(InstantDrive(), Corridor(4.0, 2.12));
  EXPECT_EQ(one.environments().observations().first[0], 1);
  EXPECT_THAT(std::vector<float>(one.frame().state.begin(), one.frame().state.end()),
              testing::Pointwise(testing::FloatEq(), {4.0f, 0.0f, -1.0f / 3.0f, 0.0f}));
  EXPECT_NEAR(one.frame().ranges_cm[359], 200, 1);
  EXPECT_NEAR(one.frame().ranges_cm[360], 200, 1);
  EXPECT_EQ(one.frame().ranges_cm[0], 500);
}

TEST(EnvironmentsTest, FrameFollowsTheRobot) {
  One one(InstantDrive(), Corridor(4.0, 9.0));
  one.Step(0.5, 1.0);
  const base::Pose2 X_WR = one.environments().robot_pose(0);
  EXPECT_NEAR(X_WR.yaw, 0.2, 1e-6);
  const base::Vec2 goal_R = base::InverseTransform(X_WR, {4.0, 0.0});
  EXPECT_FLOAT_EQ(one.frame().state[0], static_cast<float>(goal_R.x));
  EXPECT_FLOAT_EQ(one.frame().state[1], static_cast<float>(goal_R.y));
  EXPECT_FLOAT_EQ(one.frame().state[2], 0.0f);
  EXPECT_FLOAT_EQ(one.frame().state[3], static_cast<float>(1.0 / 3.14));
  EXPECT_EQ(one.environments().observations().first[0], 0);
}

TEST(EnvironmentsTest, RewardsProgressAndSuccess) {
  EnvironmentConfig config = InstantDrive();
  config.reward.slack = 0.25;
  One one(config, Corridor(1.0, 9.0));
  const env::StepResult first = one.Step(1.0);
  EXPECT_NEAR(first.reward, 0.2 - 0.25, 1e-5);
  EXPECT_EQ(first.outcome, Outcome::kRunning);
  EXPECT_NEAR(one.Step(-1.0).reward, -0.2 - 0.25, 1e-5);
  one.Step(1.0);
  one.Step(1.0);
  EXPECT_EQ(one.Step(0.95).outcome, Outcome::kRunning) << "0.41 m away";
  const env::StepResult last = one.Step(0.1);
  EXPECT_EQ(last.outcome, Outcome::kSuccess) << "0.39 m away";
  EXPECT_NEAR(last.reward, 20.0 + 0.02 - 0.25, 1e-5);
  EXPECT_EQ(last.cost, 0.0f);
}

// Steps of 0.2 m; the line is crossed in the fifth, the periods of 0.5 s end with the steps 3, 5
// and 8.
TEST(EnvironmentsTest, AFinishLineCountsWhereItIsLookedAt) {
  for (const auto& [period, last] : {std::pair{0.0, 5}, {0.5, 5}, {0.6, 6}, {0.7, 7}}) {
    EnvironmentConfig config = InstantDrive();
    config.episode.finish_ahead = 0.95;
    config.episode.look_period = period;
    One one(config, Corridor(9.0, 20.0));
    for (int step = 1; step < last; ++step) {
      EXPECT_EQ(one.Step(1.0).outcome, Outcome::kRunning) << period << " " << step;
    }
    EXPECT_EQ(one.Step(1.0).outcome, Outcome::kSuccess) << period;
  }
  EnvironmentConfig config = InstantDrive();
  One without(config, Corridor(9.0, 20.0));
  for (int step = 0; step < 20; ++step) EXPECT_EQ(without.Step(1.0).outcome, Outcome::kRunning);
}

// In double precision 43 * 0.2 / 0.2 is below 43. The line is crossed in step 43, too.
TEST(EnvironmentsTest, APeriodOfOneStepLooksAtEachStep) {
  EnvironmentConfig config = InstantDrive();
  config.episode.look_period = config.episode.step;
  config.episode.finish_ahead = 42.5 * 0.2;
  One one(config, Corridor(20.0, 30.0));
  for (int step = 1; step < 43; ++step) ASSERT_EQ(one.Step(1.0).outcome, Outcome::kRunning) << step;
  EXPECT_EQ(one.Step(1.0).outcome, Outcome::kSuccess);
}

TEST(EnvironmentsTest, OdometryFromWheelsTellsTheirSpeed) {
  EnvironmentConfig config;
  config.localisation.from_wheels = true;
  One one(config, Corridor(9.0, 20.0));
  for (int step = 0; step < 3; ++step) one.Step(1.0, 2.0);
  const env::Odometry& odometry = one.environments().observations().odometry[0];
  EXPECT_NEAR(odometry.linear, 1.0, 1e-6);
  const base::Pose2 X_WR = one.environments().robot_pose(0);
  EXPECT_NEAR(base::WrapAngle(odometry.X_OR.yaw - X_WR.yaw), 0.0, 1e-6) << "the heading is true";
  EXPECT_GT(base::Norm(odometry.X_OR.p - X_WR.p), 0.005) << "the tyres slip";
}

TEST(EnvironmentsTest, WheelsRollAsTheDriveLetsThem) {
  EnvironmentConfig config;
  config.localisation.from_wheels = true;
  config.robot.linear_speed_limit = 0.5;
  config.robot.command_delay = 0.1;
  config.robot.linear_acceleration = 2.0;
  One one(config, Corridor(9.0, 20.0));
  // Nothing for 5 ticks of 0.02 s, then 0.04 m/s more in each of the other 5.
  one.Step(1.0);
  const auto odometry = [&] { return one.environments().observations().odometry[0]; };
  EXPECT_NEAR(odometry().linear, 0.2, 1e-6);
  EXPECT_NEAR(odometry().X_OR.p.x, 0.02 * 0.04 * (1 + 2 + 3 + 4 + 5), 1e-6);
  one.Step(1.0);
  EXPECT_NEAR(odometry().linear, 0.5, 1e-6) << "the limit";
}

TEST(EnvironmentsTest, TheBeliefDecidesOnArrivalIfAsked) {
  struct Distances {
    double believed, really;
  };
  const auto drive = [](bool decides) {
    EnvironmentConfig config = InstantDrive();
    config.localisation.position_drift = 0.3;
    config.localisation.decides_arrival = decides;
    One one(config, Corridor(4.0, 20.0));
    while (one.Step(0.5).outcome == Outcome::kRunning) {
    }
    const auto state = one.frame().state;
    return Distances{std::hypot(state[0], state[1]), std::abs(4.0 - one.x())};
  };
  const double tolerance = EnvironmentConfig().episode.goal_tolerance;
  const Distances at_goal = drive(false);
  EXPECT_LT(at_goal.really, tolerance);
  EXPECT_GT(at_goal.believed, tolerance);
  const Distances at_belief = drive(true);
  EXPECT_LT(at_belief.believed, tolerance);
  EXPECT_GT(at_belief.really, tolerance);
}

TEST(EnvironmentsTest, GoalCountsAtTheEndOfAStepOnly) {
  EnvironmentConfig config = InstantDrive();
  config.episode.goal_tolerance = 0.05;
  One one(config, Corridor(0.2, 9.0));
  EXPECT_EQ(one.Step(2.0).outcome, Outcome::kRunning)
      << "passed the goal at 0.1 s, 0.2 m beyond at 0.2 s";
}

TEST(EnvironmentsTest, CollisionCostsAndEndsTheEpisode) {
  // The front is at 0.229 m, the wall at 0.6 m: after 0.2 m a gap of 0.171 m.
  One one(InstantDrive(), Corridor(3.0, 0.6));
  EXPECT_EQ(one.Step(1.0).outcome, Outcome::kRunning);
  const double before = one.x();
  const env::StepResult result = one.Step(1.0);
  EXPECT_EQ(result.outcome, Outcome::kCollision);
  EXPECT_EQ(result.cost, 1.0f);
  EXPECT_NEAR(result.reward, (one.x() - before) - 4.0, 1e-5);
  const double after = one.x();
  const std::vector<std::uint16_t> scan(one.frame().ranges_cm.begin(), one.frame().ranges_cm.end());
  one.Step(-1.0);
  EXPECT_EQ(one.x(), after) << "stands still until reset";
  EXPECT_TRUE(std::equal(scan.begin(), scan.end(), one.frame().ranges_cm.begin()));
}

TEST(EnvironmentsTest, CollisionThatEndsNothingCostsAsLongAsItLasts) {
  EnvironmentConfig config = InstantDrive();
  config.episode.collision_ends = false;
  One one(config, Corridor(1.0, 0.6));
  EXPECT_EQ(one.Step(1.0).cost, 0.0f);
  for (int i = 0; i < 5; ++i) {
    const double before = one.x();
    const env::StepResult touching = one.Step(1.0);
    EXPECT_EQ(touching.outcome, Outcome::kRunning);
    EXPECT_EQ(touching.cost, 1.0f);
    EXPECT_NEAR(touching.reward, (one.x() - before) - 4.0, 1e-5);
  }
  EXPECT_EQ(one.Step(-1.0).cost, 1.0f) << "it began in contact";
  EXPECT_EQ(one.Step(-1.0).cost, 0.0f);

  One other(config, Corridor(0.7, 0.6));
  env::StepResult result = other.Step(1.0);
  while (!result.ended()) result = other.Step(1.0);
  EXPECT_EQ(result.outcome, Outcome::kSuccess) << "0.39 m from a goal behind the wall it leans on";
  EXPECT_NEAR(result.reward, 20.0 - 4.0, 0.2);
}

TEST(EnvironmentsTest, CollisionComesBeforeSuccess) {
  One one(InstantDrive(), Corridor(0.6, 0.6));
  EXPECT_EQ(one.Step(2.0).outcome, Outcome::kCollision);
}

TEST(EnvironmentsTest, StoppingShortOfAWallIsNoCollision) {
  One one(InstantDrive(), Corridor(3.0, 0.6));
  EXPECT_EQ(one.Step(1.85).outcome, Outcome::kRunning) << "0.37 of 0.371 m";
  EXPECT_EQ(one.Step(0.1).outcome, Outcome::kCollision);
}

TEST(EnvironmentsTest, StepLimitIsATimeoutAndNotTerminal) {
  EnvironmentConfig config = InstantDrive();
  config.reward.timeout = 3.0;
  One one(config, Corridor(3.0, 9.0));
  for (int i = 0; i < 399; ++i) ASSERT_EQ(one.Step(0.0).outcome, Outcome::kRunning);
  const env::StepResult last = one.Step(0.0);
  EXPECT_EQ(last.outcome, Outcome::kTimeout);
  EXPECT_FALSE(last.terminated());
  EXPECT_EQ(last.reward, -3.0f);
}

TEST(EnvironmentsTest, ArrivingInTheLastStepIsASuccess) {
  EnvironmentConfig config = InstantDrive();
  config.episode.max_steps = 3;
  config.reward.timeout = 3.0;
  One one(config, Corridor(0.9, 9.0));
  ASSERT_EQ(one.Step(1.0).outcome, Outcome::kRunning);
  ASSERT_EQ(one.Step(1.0).outcome, Outcome::kRunning) << "0.5 m away";
  const env::StepResult last = one.Step(1.0);
  EXPECT_EQ(last.outcome, Outcome::kSuccess) << "0.3 m away";
  EXPECT_TRUE(last.terminated());
  EXPECT_NEAR(last.reward, 20.0 + 0.2, 1e-5);
}

TEST(EnvironmentsTest, ActionsAreClipped) {
  EnvironmentConfig config = InstantDrive();
  // Above what +-1 stands for, so that the drive clips nothing.
  config.robot.linear_speed_limit = 5.0;
  config.robot.angular_speed_limit = 10.0;
  for (const float sign : {1.0f, -1.0f}) {
    One beyond(config, Corridor(5.0, 9.0)), at(config, Corridor(5.0, 9.0));
    std::vector<env::StepResult> results(1);
    beyond.environments().Step(
        env::NumbersOf(std::vector<env::Action>{{7.0f * sign, -7.0f * sign}}), results);
    at.environments().Step(env::NumbersOf(std::vector<env::Action>{{sign, -sign}}), results);
    EXPECT_EQ(beyond.frame().state[2], sign);
    EXPECT_EQ(beyond.frame().state[3], -sign);
    EXPECT_EQ(beyond.environments().robot_pose(0), at.environments().robot_pose(0));
  }
}

TEST(EnvironmentsTest, RefusesACourseThatStartsInContact) {
  try {
    CourseEnvironments({}, {Corridor(3.0, 9.0), Corridor(3.0, 0.1)}, 1, nullptr);
    FAIL();
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("course 'corridor'"));
    EXPECT_THAT(error.what(), testing::HasSubstr("start pose"));
  }
}

TEST(EnvironmentsTest, JitteredStartsAreSpreadAndFree) {
  EnvironmentConfig config;
  config.episode.start_position_jitter = 0.3;
  config.episode.start_yaw_jitter = 0.4;
  // The wall leaves 0.071 m ahead at the start.
  CourseEnvironments environments(config, {Corridor(3.0, 0.3)}, 1, nullptr);
  std::vector<env::Action> stand{config.action.Normalise(0.0, 0.0)};
  std::vector<env::StepResult> results(1);
  double min_x = 9.0, max_x = -9.0, min_yaw = 9.0, max_yaw = -9.0;
  for (std::uint64_t seed = 0; seed < 300; ++seed) {
    environments.Reset(0, {0, seed});
    const base::Pose2 start = environments.robot_pose(0);
    min_x = std::min(min_x, start.p.x);
    max_x = std::max(max_x, start.p.x);
    min_yaw = std::min(min_yaw, start.yaw);
    max_yaw = std::max(max_yaw, start.yaw);
    EXPECT_LE(std::abs(start.p.y), 0.3);
    environments.Step(env::NumbersOf(stand), results);
    EXPECT_EQ(results[0].outcome, Outcome::kRunning);
  }
  EXPECT_GE(min_x, -0.3 - 1e-6);
  EXPECT_LT(min_x, -0.28);
  EXPECT_LE(max_x, 0.0711);
  EXPECT_GT(max_x, 0.02);
  EXPECT_LT(min_yaw, -0.38);
  EXPECT_GT(max_yaw, 0.38);
}

TEST(EnvironmentsTest, ProgressBeginsAtTheJitteredStart) {
  EnvironmentConfig config = InstantDrive();
  config.episode.start_position_jitter = 0.3;
  config.reward.slack = 0.25;
  CourseEnvironments environments(config, {Corridor(3.0, 9.0)}, 1, nullptr);
  std::vector<env::StepResult> results(1);
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    environments.Reset(0, {0, seed});
    environments.Step(env::NumbersOf(std::vector{config.action.Normalise(0.0, 0.0)}), results);
    EXPECT_EQ(results[0].reward, -0.25f) << "it stands";
  }
}

TEST(EnvironmentsTest, ATurnedAndMovedCourseGivesTheSameEpisode) {
  base::Random random(9);
  for (int round = 0; round < 10; ++round) {
    const auto course = test::WithMoving(
        *test::RandomCourse(random, {.num_circles = 40, .num_boxes = 3}), round % 3, random);
    const base::Pose2 X_VW{{random.Uniform(-3.0, 3.0), random.Uniform(-3.0, 3.0)},
                           random.Uniform(-3.0, 3.0)};
    Course moved = *course;
    for (Circle& circle : moved.circles) circle.p_W = base::Transform(X_VW, circle.p_W);
    for (Box& box : moved.boxes) {
      box.X_WB = {base::Transform(X_VW, box.X_WB.p), box.X_WB.yaw + X_VW.yaw};
    }
    for (MovingObstacle& obstacle : moved.moving) {
      for (auto& [time, X_WB] : obstacle.key_frames) {
        X_WB = {base::Transform(X_VW, X_WB.p), X_WB.yaw + X_VW.yaw};
      }
    }
    moved.start = {base::Transform(X_VW, course->start.p), course->start.yaw + X_VW.yaw};
    moved.goal_W = base::Transform(X_VW, course->goal_W);
    const std::shared_ptr<const Scene> scenes[] = {
        MakeScene(course), MakeScene(std::make_shared<const Course>(moved))};
    EnvironmentConfig config;
    config.lidar.noise_std = 0.0;
    CourseEnvironments environments(config, {scenes[0], scenes[1]}, 2, nullptr);
    environments.Reset(0, {0, 1});
    environments.Reset(1, {1, 1});
    std::vector<env::StepResult> results(2);
    while (!results[0].ended()) {
      const env::Action action{static_cast<float>(random.Uniform(-1.0, 1.0)),
                               static_cast<float>(random.Uniform(-1.0, 1.0))};
      environments.Step(env::NumbersOf(std::vector{action, action}), results);
      ASSERT_EQ(results[0].outcome, results[1].outcome);
      if (results[0].ended()) break;
      // Up to 400 steps of 10 roundings of some 1e-6 m; a beam that grazes an obstacle may go
      // either way.
      const base::Vec2 p = base::Transform(X_VW, environments.robot_pose(0).p);
      ASSERT_LT(base::Norm(p - environments.robot_pose(1).p), 4e-3);
      const auto& observations = environments.observations();
      int different = 0;
      for (int i = 0; i < observations.num_beams; ++i) {
        different +=
            std::abs(observations.frame(0).ranges_cm[i] - observations.frame(1).ranges_cm[i]) > 2;
      }
      ASSERT_LT(different, 15);
    }
  }
}

}  // namespace
}  // namespace slalom::sim
