#include "planners/guard/shield.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "base/random.h"
#include "env/sensing/obstacle_tracker.h"
#include "sim/lidar.h"
#include "sim/moving_obstacles.h"
#include "sim/robot.h"
#include "tests/support/random_courses.h"

namespace slalom::planners {
namespace {

constexpr double kStep = 0.2;
constexpr int kTicks = 10;
const env::ActionBounds kBounds;

sim::LidarConfig LidarWith(double field_of_view, double noise) {
  sim::LidarConfig config;
  config.noise_std = noise;
  config.field_of_view = field_of_view;
  return config;
}

/// A robot of the simulator on a course, and the shield that is told of it.
class Guarded {
 public:
  explicit Guarded(std::shared_ptr<const sim::Course> course, double delay = 0.0,
                   GuardConfig config = {}, double field_of_view = 4.71238, double jitter = 0.0,
                   double noise = 0.0, std::uint64_t seed = 0)
      : scene_(sim::MakeScene(std::move(course))),
        robot_(RobotWithDelay(delay, jitter), kTicks),
        lidar_(LidarWith(field_of_view, noise), 5.0),
        noise_(seed),
        shield_(config, {.least_delay = delay, .delay = delay + jitter},
                {.field_of_view = field_of_view}, kBounds, kStep),
        ranges_(static_cast<std::size_t>(lidar_.num_beams())) {
    if (config.tracking) tracker_.emplace(env::ScanGeometry{.field_of_view = field_of_view}, kStep);
    Reset();
  }
  void Reset(std::shared_ptr<const sim::Course> course = nullptr) {
    if (course) scene_ = sim::MakeScene(std::move(course));
    robot_.Reset({});
    shield_.Reset();
    if (tracker_) tracker_->Reset();
    time_ = 0.0;
  }
  Shield& See() {
    scene_->moving_obstacles().PlaceAll(time_, moving_);
    lidar_.Scan(scene_->collision_map(), robot_.pose(), noise_, ranges_, &moving_);
    const sim::BodyState& body = robot_.body();
    const auto [s, c] = base::SinCos(robot_.pose().yaw);
    std::span<const env::Track> tracks;
    if (tracker_) {
      tracker_->Update(ranges_, robot_.pose());
      tracks = tracker_->tracks();
    }
    shield_.See(ranges_, {robot_.pose(), c * body.vx + s * body.vy, body.yaw_rate}, tracks);
    return shield_;
  }
  /// Returns whether it touched something.
  bool Drive(Twist command) {
    const double time = std::exchange(time_, time_ + kStep);
    return robot_.Drive(command.linear, command.angular, *scene_, time);
  }
  /// Whether the robot touches something in the next two seconds, if it takes the command for a
  /// step, however it goes on for 0.6 s before it brakes.
  bool CannotEscape(Twist command) const {
    for (int i = 0; i < 35; ++i) {
      const Twist next = i == 0 ? command : Twist{-1.0 + 0.5 * (i % 7), -3.14 + 1.57 * (i / 7)};
      sim::Robot other = robot_;
      double time = time_;
      bool touched = false;
      for (int step = 0; step < 10 && !touched; ++step, time += kStep) {
        const Twist now = step == 0 ? command : step <= 3 ? next : Twist{};
        touched = other.Drive(now.linear, now.angular, *scene_, time);
      }
      if (!touched) return false;
    }
    return true;
  }
  /// Whether the robot touches something if it takes the command for a step and then brakes.
  bool BrakesTooLate(Twist command) const {
    sim::Robot other = robot_;
    bool touched = other.Drive(command.linear, command.angular, *scene_, 0.0);
    for (int i = 0; i < 15 && !touched; ++i) touched = other.Drive(0.0, 0.0, *scene_, 0.0);
    return touched;
  }
  const sim::Robot& robot() const { return robot_; }

 private:
  static sim::RobotConfig RobotWithDelay(double delay, double jitter) {
    sim::RobotConfig config;
    config.command_delay = delay;
    config.command_jitter = jitter;
    return config;
  }

  std::shared_ptr<const sim::Scene> scene_;
  sim::Robot robot_;
  sim::Lidar lidar_;
  base::Random noise_;
  Shield shield_;
  std::optional<env::ObstacleTracker> tracker_;
  std::vector<std::uint16_t> ranges_;
  sim::MovingShapes moving_;
  double time_ = 0.0;  // [s]
};

std::shared_ptr<const sim::Course> CourseOf(std::vector<sim::Box> boxes) {
  sim::Course course;
  course.bounds = {{-8.0, -8.0}, {8.0, 8.0}};
  course.boxes = std::move(boxes);
  return std::make_shared<const sim::Course>(std::move(course));
}
sim::Box WallAt(double x, double y, double half_x, double half_y) {
  return {{{x, y}, 0.0}, {half_x, half_y}};
}

struct Drives {
  int num_steps = 0, num_passed = 0, num_changed = 0, num_touched_after_pass = 0, num_touched = 0;
};

/// Robots that are told to drive at random, each by its shield, until they touch something.
Drives DriveAtRandom(double delay, double jitter, int num_courses) {
  base::Random random(7);
  Drives drives;
  for (int i = 0; i < num_courses; ++i) {
    Guarded guarded(
        test::RandomCourse(random, {.num_circles = 25, .num_boxes = 6, .clear_start = 0.6}), delay,
        {}, 6.275, jitter);
    Twist wanted;
    for (int step = 0; step < 60; ++step) {
      if (step % 4 == 0) wanted = {random.Uniform(-1.0, 2.0), random.Uniform(-3.14, 3.14)};
      const Shield::Choice choice = guarded.See().Choose(wanted);
      ++drives.num_steps;
      drives.num_changed += choice.changed;
      if (choice.clearance > 0.0) {
        ++drives.num_passed;
        drives.num_touched_after_pass += guarded.BrakesTooLate(choice.command);
      }
      if (guarded.Drive(choice.command)) {
        ++drives.num_touched;
        break;
      }
    }
  }
  return drives;
}

TEST(ShieldTest, WhatPassesLeadsToNoTouchThatBrakingCannotPrevent) {
  constexpr int kNumCourses = 20;
  struct Case {
    double delay, jitter;
  };
  for (const auto& [delay, jitter] :
       {Case{0.0, 0.0}, Case{0.06, 0.0}, Case{0.1, 0.0}, Case{0.3, 0.0}, Case{0.0, 0.2}}) {
    const Drives drives = DriveAtRandom(delay, jitter, kNumCourses);
    EXPECT_GT(drives.num_changed, drives.num_steps / 20) << "the courses are too easy";
    EXPECT_GT(drives.num_steps, kNumCourses * 50) << "the robots do not last";
    EXPECT_EQ(drives.num_touched_after_pass, 0) << delay;
    EXPECT_EQ(drives.num_touched, 0) << delay;
  }
}

TEST(ShieldTest, WhatIsFarAwayChangesNothing) {
  Guarded guarded(CourseOf({WallAt(5.0, 0.0, 0.1, 4.0)}));
  const Shield::Choice choice = guarded.See().Choose({2.0, -3.0});
  EXPECT_FALSE(choice.changed);
  EXPECT_EQ(choice.command, (Twist{2.0, -3.0}));
}

// The nearest of many noisy points is too near, so the robot seems to be closer than the margin,
// and may go on as long as it comes no closer. Without more neighbours in a mean, and without the
// promise of the last command, 40 touch the wall that they are told to turn to.
TEST(ShieldTest, NoiseLetsFewRobotsCreepUpToAWall) {
  int num_touched = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    Guarded guarded(CourseOf({WallAt(3.0, 0.37, 6.0, 0.1)}), 0.0, {}, 4.71238, 0.0, 0.022, seed);
    bool touched = false;
    for (int i = 0; i < 35 && !touched; ++i) {
      touched = guarded.Drive(guarded.See().Choose({1.0, 0.1}).command);
    }
    num_touched += touched;
    EXPECT_GT(guarded.robot().pose().p.x, 1.0) << seed;
  }
  EXPECT_LE(num_touched, 15);
}

TEST(ShieldTest, StopsInFrontOfAWallAtTheMargin) {
  for (const double delay : {0.0, 0.3}) {
    Guarded guarded(CourseOf({WallAt(3.0, 0.0, 0.1, 4.0)}), delay);
    int num_changed = 0;
    for (int i = 0; i < 40; ++i) {
      const Shield::Choice choice = guarded.See().Choose({2.0, 0.0});
      num_changed += choice.changed;
      ASSERT_FALSE(guarded.Drive(choice.command)) << delay;
    }
    EXPECT_GT(num_changed, 20);
    // It may turn, as that is nearer to what it was told than to stand.
    EXPECT_GT(guarded.robot().pose().p.x, 1.5) << delay;
  }
}

// Turns to a wall that was behind, and back again, stands for a while and then reverses.
TEST(ShieldTest, RemembersWhatIsBehindWhereverItIsAndHoweverLongItStands) {
  struct Case {
    double wall_x, memory;
    int num_waits;
    bool touches;
  };
  for (const Case& c :
       {Case{-0.6, 10.0, 0, false}, Case{-2.0, 10.0, 60, false}, Case{-0.6, 0.0, 0, true}}) {
    Guarded guarded(CourseOf({WallAt(c.wall_x, 0.0, 0.05, 1.0)}), 0.0, {.memory = c.memory}, 2.0);
    bool touched = false;
    const auto drive = [&](const Twist& wanted) {
      touched |= guarded.Drive(guarded.See().Choose(wanted).command);
    };
    const auto turn = [&](double to) {
      for (int i = 0; std::abs(base::WrapAngle(guarded.robot().pose().yaw - to)) > 0.2; ++i) {
        ASSERT_LT(i, 60);
        drive({0.0, base::WrapAngle(to - guarded.robot().pose().yaw) > 0.0 ? 2.0 : -2.0});
      }
    };
    turn(3.0);
    turn(0.0);
    for (int i = 0; i < c.num_waits; ++i) drive({});
    for (int i = 0; i < 30; ++i) drive({-0.5, 0.0});
    EXPECT_EQ(touched, c.touches) << c.wall_x << " " << c.memory;
  }
}

/// Boxes and cylinders on straight ways that cross near the robot within seconds, one after
/// another.
std::shared_ptr<const sim::Course> MovingCourse(base::Random& random) {
  sim::Course course;
  course.bounds = {{-20.0, -20.0}, {20.0, 20.0}};
  for (int i = 0; i < 4; ++i) {
    const double heading = random.Uniform(-3.14, 3.14), speed = random.Uniform(0.5, 1.4);
    const auto [s, c] = base::SinCos(heading);
    const base::Vec2 crossing{random.Uniform(-0.4, 0.6), random.Uniform(-0.4, 0.4)};
    const double time_there = 2.0 + 2.5 * i;
    // Of a way that takes 20 s; the speed changes slowly along it (sim/courses/motion.h).
    const base::Vec2 way = (20.0 * speed) * base::Vec2{c, s};
    const double u = time_there / 20.0, gone = 0.5 * u + 1.5 * u * u - u * u * u;
    sim::MovingObstacle obstacle;
    if (i % 2 == 0) {
      obstacle.radius = random.Uniform(0.15, 0.4);
    } else {
      obstacle.half_size = {random.Uniform(0.1, 0.3), random.Uniform(0.1, 0.3)};
    }
    const base::Vec2 from = crossing - gone * way;
    obstacle.key_frames = {{0.0, {from, heading}}, {20.0, {from + way, heading}}};
    course.moving.push_back(obstacle);
  }
  return std::make_shared<const sim::Course>(std::move(course));
}

/// Robots that are told to stand or to drive at random, until they are touched.
Drives DriveAmongWhatMoves(bool tracking, int num_courses, double delay = 0.0) {
  base::Random random(11);
  Drives drives;
  for (int i = 0; i < num_courses; ++i) {
    // It sees all around.
    Guarded guarded(MovingCourse(random), delay, {.tracking = tracking}, 6.275);
    Twist wanted;
    for (int step = 0; step < 50; ++step) {
      if (i % 2 == 0 && step % 8 == 0) {
        wanted = {random.Uniform(-0.5, 1.0), random.Uniform(-1.5, 1.5)};
      }
      const Shield::Choice choice = guarded.See().Choose(wanted);
      ++drives.num_steps;
      drives.num_changed += choice.changed;
      if (step > 5 && choice.clearance > 0.03) {
        ++drives.num_passed;
        drives.num_touched_after_pass += guarded.CannotEscape(choice.command);
      }
      if (guarded.Drive(choice.command)) {
        ++drives.num_touched;
        break;
      }
    }
  }
  return drives;
}

TEST(ShieldTest, EvadesWhatMovesIfItIsTracked) {
  constexpr int kNumCourses = 40;
  const Drives blind = DriveAmongWhatMoves(false, kNumCourses);
  EXPECT_GT(blind.num_touched, kNumCourses / 2) << "the courses are too easy";
  for (const double delay : {0.0, 0.1}) {
    const Drives drives = DriveAmongWhatMoves(true, kNumCourses, delay);
    EXPECT_LT(drives.num_touched, kNumCourses / 4) << delay;
    EXPECT_GT(drives.num_passed, drives.num_steps / 2) << delay;
    EXPECT_LT(drives.num_touched_after_pass, drives.num_passed / 200) << delay;
    EXPECT_LT(drives.num_changed, drives.num_steps / 2) << "it goes on where it may, " << delay;
  }
}

TEST(ShieldTest, TracksChangeNothingWhereNothingMovesNear) {
  const auto course = CourseOf({WallAt(1.2, 0.0, 0.1, 4.0)});
  Guarded plain(course), tracking(course, 0.0, {.tracking = true});
  int num_changed = 0;
  for (int i = 0; i < 30; ++i) {
    const Twist wanted{0.1 * (i % 20), 0.3 * (i % 7) - 1.0};
    const Shield::Choice choice = plain.See().Choose(wanted);
    EXPECT_EQ(tracking.See().Choose(wanted).command, choice.command) << i;
    num_changed += choice.changed;
    plain.Drive(choice.command);
    tracking.Drive(choice.command);
  }
  EXPECT_GT(num_changed, 5);
}

// The range finder does not show it now, as something is before it or it is behind.
TEST(ShieldTest, EvadesWhatIsHidden) {
  const std::vector<std::uint16_t> open(720, 500);
  for (const base::Vec2 from : {base::Vec2{1.2, 0.1}, {-1.0, 0.0}, {0.1, 1.2}}) {
    Shield shield({.shield = true, .tracking = true}, {}, {}, kBounds, kStep);
    const env::Track there{.p_O = from, .v_O = -1.2 * from, .radius = 0.3};
    shield.See(open, {}, std::array{there});
    EXPECT_TRUE(shield.Choose({}).changed);
    shield.Reset();
    shield.See(open, {}, std::array{env::Track{.p_O = from, .v_O = 1.2 * from, .radius = 0.3}});
    EXPECT_FALSE(shield.Choose({}).changed) << "it goes away";
  }
}

// Whatever it was told and has seen before, wherever the robot ended.
TEST(ShieldTest, BeginsAnEpisodeAsAFreshShield) {
  base::Random random(9);
  int num_changed = 0;
  for (int i = 0; i < 40; ++i) {
    const auto draw = [&random] {
      return test::RandomCourse(random, {.num_circles = 40, .clear_start = 0.36});
    };
    const auto course = draw();
    Guarded used(draw(), 0.3, {}, 2.0), fresh(course, 0.3, {}, 2.0);
    const Twist before = i % 2 == 0 ? Twist{0.0, 3.0} : Twist{1.0, random.Uniform(-3.0, 3.0)};
    for (int step = 0; step < 10; ++step) used.Drive(used.See().Choose(before).command);
    used.Reset(course);
    const Twist wanted{random.Uniform(-1.0, 2.0), random.Uniform(-3.14, 3.14)};
    for (int step = 0; step < 8; ++step) {
      const Shield::Choice choice = fresh.See().Choose(wanted);
      ASSERT_EQ(used.See().Choose(wanted).command, choice.command) << i << ", step " << step;
      num_changed += choice.changed;
      used.Drive(choice.command);
      fresh.Drive(choice.command);
    }
  }
  EXPECT_GT(num_changed, 10) << "the courses are too easy";
}

}  // namespace
}  // namespace slalom::planners
