#include "sim/moving_obstacles.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "base/error.h"
#include "sim/environments.h"
#include "tests/support/moving_courses.h"
#include "tests/support/random_courses.h"

namespace slalom::sim {
namespace {

using env::Outcome;

MovingObstacle BoxBetween(base::Pose2 from, base::Pose2 to, double duration, base::Vec2 half_size) {
  MovingObstacle obstacle;
  obstacle.half_size = half_size;
  obstacle.key_frames = {{0.0, from}, {duration, to}};
  return obstacle;
}

TEST(MovingObstaclesTest, ScansAreThoseOfTheFrozenCourse) {
  base::Random random(1);
  const Lidar lidar({}, 5.0);
  std::vector<float> found(lidar.num_beams()), expected(lidar.num_beams());
  for (int round = 0; round < 40; ++round) {
    const auto fixed = test::RandomCourse(random, {.num_circles = 10, .num_boxes = 2});
    const auto course = test::WithMoving(*fixed, round % 13, random);
    const Scene scene(course);
    MovingShapes shapes;
    for (int k = 0; k < 4; ++k) {
      const double time = random.Uniform(0.0, 50.0);
      const base::Pose2 X_WR{{random.Uniform(-4.0, 4.0), random.Uniform(-4.0, 4.0)},
                             random.Uniform(-3.0, 3.0)};
      scene.moving_obstacles().PlaceAll(time, shapes);
      lidar.Cast(scene.collision_map(), X_WR, found, &shapes);
      lidar.Cast(CollisionMap(test::Frozen(*course, time)), X_WR, expected);
      ASSERT_EQ(found, expected) << "round " << round;
    }
  }
}

/// What brute force says of a stretch of rigid-body steps: whether it touched anything, or came too
/// near to tell.
struct Truth {
  bool touched = false;
  bool unclear = false;
};

Truth TruthAt(const Course& course, double time, const base::Pose2& X_WR) {
  const float clearance =
      CollisionMap(test::Frozen(course, time))
          .Clearance(MakeFootprint({}), static_cast<float>(X_WR.p.x), static_cast<float>(X_WR.p.y),
                     static_cast<float>(X_WR.yaw), 1.0f);
  return {clearance <= 0.0f, std::abs(clearance) < 1e-5f};
}

TEST(MovingObstaclesTest, ContactIsWhatBruteForceFindsAtEveryRigidBodyStep) {
  constexpr double kDt = 0.02;
  base::Random random(2);
  const RobotConfig config;
  int num_contacts = 0, num_free_steps = 0;
  for (int round = 0; round < 150; ++round) {
    const auto course =
        test::WithMoving(*test::RandomCourse(random, {.num_circles = 3}), 6, random);
    const Scene scene(course);
    // The second robot goes the same way a rigid-body step at a time, so that it can be looked at.
    Robot robot(config, 10), twin(config, 1);
    const base::Pose2 start{{random.Uniform(-2.0, 2.0), random.Uniform(-2.0, 2.0)},
                            random.Uniform(-3.0, 3.0)};
    robot.Reset(start);
    twin.Reset(start);
    double time = random.Uniform(0.0, 1000.0);
    for (int step = 0; step < 40; ++step) {
      const double linear = random.Uniform(-2.0, 2.0), angular = random.Uniform(-3.0, 3.0);
      Truth truth = TruthAt(*course, time, twin.pose());
      for (int substep = 0; substep < 10; ++substep) {
        twin.Drive(linear, angular, scene, time + substep * kDt);
        const Truth now = TruthAt(*course, time + (substep + 1) * kDt, twin.pose());
        truth = {truth.touched || now.touched, truth.unclear || now.unclear};
      }
      const bool touched = robot.Drive(linear, angular, scene, time);
      time += 10 * kDt;
      if (truth.unclear) break;
      ASSERT_EQ(touched, truth.touched) << "round " << round << ", step " << step;
      if (touched) {
        ++num_contacts;
        break;
      }
      ++num_free_steps;
      // The twin wraps its heading more often; 2^-22 rad each time.
      ASSERT_LT(base::Norm(robot.pose().p - twin.pose().p), 1e-5);
      ASSERT_NEAR(base::WrapAngle(robot.pose().yaw - twin.pose().yaw), 0.0, 1e-4);
    }
  }
  EXPECT_GT(num_contacts, 70);
  EXPECT_GT(num_free_steps, 400);
}

TEST(MovingObstaclesTest, PushesARobotThatStandsInItsWay) {
  // 1 m/s in the middle of a way of 4 m from x = -2.
  Course course;
  course.moving = {BoxBetween({{-2.0, 0.0}, 0.0}, {{2.0, 0.0}, 0.0}, 5.0, {0.2, 0.3})};
  const Scene scene(std::make_shared<const Course>(course));
  const RobotConfig config;
  Robot robot(config, 10);
  robot.Reset({});
  const Motion motion(course.moving[0]);
  int num_touched = 0;
  for (int step = 0; step < 25; ++step) {
    num_touched += robot.Drive(0.0, 0.0, scene, 0.2 * step);
    // Its front is pushed along; a rigid-body step at 1 m/s is 0.02 m, and Box2D takes back a fifth
    // of what overlaps in each of three rounds a step.
    const double front = motion.At(0.2 * (step + 1) - 1e-9).X_WB.p.x + 0.2;
    EXPECT_GT(robot.pose().p.x - 0.229, front - 0.06) << "at step " << step;
    EXPECT_NEAR(robot.pose().p.y, 0.0, 0.01);
  }
  EXPECT_GT(num_touched, 10);
  EXPECT_GT(robot.pose().p.x, 2.0);
}

/// One environment on one course, standing still unless told otherwise.
class One {
 public:
  One(const EnvironmentConfig& config, const Course& course, std::uint64_t seed = 0)
      : environments_(config, {MakeScene(std::make_shared<const Course>(course))}, 1, nullptr) {
    environments_.Reset(0, {0, seed});
  }
  env::StepResult Stand() {
    const std::vector<env::Action> actions{environments_.config().action.Normalise(0.0, 0.0)};
    environments_.Step(env::NumbersOf(actions), results_);
    return results_[0];
  }
  CourseEnvironments& environments() { return environments_; }
  double motion_time() const { return environments_.motion_time(0); }

 private:
  CourseEnvironments environments_;
  std::vector<env::StepResult> results_{1};
};

Course OpenCourse() {
  Course course;
  course.name = "open";
  course.goal_W = {9.0, 0.0};
  return course;
}

TEST(MovingObstaclesTest, ScansShowObstaclesAtTheEndOfTheStep) {
  // A wall that comes towards the robot at 0.1 m/s on average, and never reaches it.
  Course course = OpenCourse();
  course.moving = {BoxBetween({{5.0, 0.0}, 0.0}, {{2.0, 0.0}, 0.0}, 30.0, {0.05, 9.0})};
  course.moving[0].playback = Playback::kPingPong;
  EnvironmentConfig config;
  config.lidar.noise_std = 0.0;
  const Motion motion(course.moving[0]);
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    One one(config, course, seed);
    const double start = one.motion_time();
    for (int step = 0; step <= 40; ++step) {
      EXPECT_DOUBLE_EQ(one.motion_time(), start + 0.2 * step);
      const double range = motion.At(one.motion_time()).X_WB.p.x - 0.05 - 0.12;
      // The middle beams are a quarter of a degree off: 1 / cos - 1 = 1e-5; rounded to 0.01 m.
      EXPECT_NEAR(one.environments().observations().frame(0).ranges_cm[360], 100.0 * range, 0.51);
      ASSERT_EQ(one.Stand().outcome, Outcome::kRunning);
    }
  }
}

TEST(MovingObstaclesTest, AnObstacleThatArrivesOrJumpsOnTheRobotCollides) {
  // Stays some 0.4 m beside the robot's flank for 7 s, then begins anew on top of it, for longer
  // than a rigid-body step. And one that drives over it once a round.
  Course jumping = OpenCourse();
  MovingObstacle jumper;
  jumper.radius = 0.1;
  jumper.key_frames = {
      {0.0, {{0.0, 0.0}, 0.0}}, {0.1, {{0.0, 0.7}, 0.0}}, {7.0, {{0.0, 0.7}, 0.0}}};
  jumping.moving = {jumper};
  Course crossing = OpenCourse();
  crossing.moving = {BoxBetween({{0.0, -3.0}, 0.5}, {{0.0, 3.0}, 0.5}, 6.0, {0.1, 0.1})};
  for (const Course& course : {jumping, crossing}) {
    const Motion motion(course.moving[0]);
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      One one({}, course, seed);
      // Brute force: the first control step in which the frozen course touches.
      const double start = one.motion_time();
      int expected = -1;
      for (int k = 0; expected < 0; ++k) {
        ASSERT_LT(k, 1000);
        if (TruthAt(course, start + 0.02 * k, {}).touched) expected = (k + 9) / 10;
      }
      int step = 0;
      while (one.Stand().outcome == Outcome::kRunning) ++step;
      EXPECT_EQ(step + 1, expected) << "seed " << seed;
      EXPECT_GT(expected, 0) << "never at the start";
    }
  }
}

TEST(MovingObstaclesTest, EpisodesBeginAtAnyPhaseInWhichTheStartIsFree) {
  Course course = OpenCourse();
  course.moving = {BoxBetween({{0.0, -4.0}, 0.0}, {{0.0, 4.0}, 0.0}, 10.0, {0.1, 0.1})};
  const EnvironmentConfig config;
  CourseEnvironments environments(config, {MakeScene(std::make_shared<const Course>(course))}, 1,
                                  nullptr);
  constexpr int kSeeds = 4000;
  std::vector<int> tenths(10);
  const Motion motion(course.moving[0]);
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    environments.Reset(0, {0, seed});
    const double time = environments.motion_time(0);
    EXPECT_GE(time, 0.0);
    EXPECT_LT(time, 1000.0);
    EXPECT_GT(std::abs(motion.At(time).X_WB.p.y), 0.308) << "not on the robot";
    ++tenths[static_cast<int>(std::fmod(time, 10.0))];
  }
  // It passes the middle at 1 m/s: 0.616 of 10 s are not free, in the middle two tenths. The others
  // hold 1 / 9.384 of all each: 426, standard deviation 19.5.
  for (int i = 0; i < 10; ++i) {
    const double expected = kSeeds * (i == 4 || i == 5 ? 0.692 : 1.0) / 9.384;
    EXPECT_NEAR(tenths[i], expected, 5.0 * std::sqrt(expected)) << i;
  }
}

TEST(MovingObstaclesTest, RefusesACourseWhoseStartIsNeverFree) {
  Course course = OpenCourse();
  course.moving = {BoxBetween({{0.0, 0.0}, 0.0}, {{0.1, 0.0}, 0.0}, 3.0, {0.1, 0.1})};
  try {
    One one({}, course);
    FAIL();
  } catch (const base::Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("course 'open': moving obstacles touch"));
  }
}

}  // namespace
}  // namespace slalom::sim
