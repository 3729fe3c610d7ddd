#include "env/sensing/obstacle_tracker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/random.h"
#include "sim/courses/course.h"
#include "sim/courses/course_sets.h"
#include "sim/lidar.h"
#include "sim/scene.h"
#include "tests/support/scan_walk.h"
#include "tests/support/seen_obstacles.h"

namespace slalom::planners {
namespace {

using test::ScanWalk;

/// Walks to the goal, and holds each track against the truth.
void Walk(ScanWalk& walk, test::TrackingErrors& errors) {
  env::ObstacleTracker tracker(walk.geometry(), ScanWalk::kStep);
  test::SeenObstacles seen(walk);
  while (walk.Step()) {
    tracker.Update(walk.ranges_cm(), walk.odometry());
    seen.Look();
    errors.Add(seen, walk, tracker.tracks());
  }
}

struct Bounds {
  double missed, wrong, place, velocity;  // Shares, [m], [m/s].
};

/// Courses of a kind, with noisy scans and an odometry that drifts.
void ExpectTracked(const std::string& courses, int num_beams, const Bounds& bounds) {
  test::TrackingErrors errors;
  for (const auto& course : sim::ResolveCourses(courses, std::nullopt, 1).courses) {
    ScanWalk walk(*course, 1, num_beams);
    Walk(walk, errors);
  }
  EXPECT_GT(errors.num_obstacles, 300.0);
  EXPECT_LT(errors.num_missed, bounds.missed * errors.num_obstacles);
  EXPECT_LT(errors.num_false, bounds.wrong * errors.num_tracks);
  EXPECT_LT(errors.place, bounds.place * errors.num_found);
  EXPECT_LT(errors.velocity, bounds.velocity * errors.num_found);
}

TEST(ObstacleTrackerTest, KnowsWhereBoxesAreAndHowTheyMove) {
  ExpectTracked("generated-box:4711:8", 720, {0.03, 0.02, 0.09, 0.14});
}

TEST(ObstacleTrackerTest, KnowsItWithAnotherRangeFinder) {
  ExpectTracked("generated-box:4711:8", 270, {0.08, 0.04, 0.11, 0.22});
}

TEST(ObstacleTrackerTest, KnowsItAmongCrowdsThatTurnAndHideOneAnother) {
  ExpectTracked("generated-crowds:4711:12", 720, {0.15, 0.08, 0.14, 0.22});
}

TEST(ObstacleTrackerTest, WhatStandsDoesNotMove) {
  for (const char* courses : {"generated:4711:8", "generated-halls:4711:8"}) {
    double num_tracks = 0.0, num_scans = 0.0;
    for (const auto& course : sim::ResolveCourses(courses, std::nullopt, 1).courses) {
      ScanWalk walk(*course, 1);
      env::ObstacleTracker tracker(walk.geometry(), ScanWalk::kStep);
      while (walk.Step()) {
        tracker.Update(walk.ranges_cm(), walk.odometry());
        num_tracks += static_cast<double>(tracker.tracks().size());
        ++num_scans;
      }
    }
    EXPECT_LT(num_tracks, 0.25 * num_scans) << courses;
  }
}

/// What a robot at rest sees of one obstacle, which stands or moves at a constant velocity.
class OneObstacleTest : public testing::Test {
 protected:
  /// At p, with the velocity v, in the middle of a long way, where it hardly changes.
  void Place(base::Vec2 p, base::Vec2 v, const sim::MovingObstacle& shape, double yaw = 0.0) {
    sim::Course course;
    course.bounds = {{-20.0, -20.0}, {20.0, 20.0}};
    course.goal_W = {10.0, 0.0};
    sim::MovingObstacle obstacle = shape;
    const base::Vec2 half_way = (0.5 * kTime / kFaster) * v;
    obstacle.key_frames = {{0.0, {p - half_way, yaw}}, {kTime, {p + half_way, yaw}}};
    course.moving.push_back(obstacle);
    scene_ = sim::MakeScene(std::make_shared<const sim::Course>(course));
    time_ = 0.5 * kTime;
  }
  /// Where it is and how it moves, truly.
  sim::MovingShape Truth() const { return scene_->moving_obstacles().At(0, time_); }
  void Look(const base::Pose2& X_OR = {}) {
    time_ += kStep;
    scene_->moving_obstacles().PlaceAll(time_, shapes_);
    lidar_.Scan(scene_->collision_map(), X_OR, noise_, ranges_, &shapes_);
    tracker_.Update(ranges_, X_OR);
  }

  static constexpr double kStep = 0.2, kTime = 20.0;
  static constexpr double kFaster = 1.25;  // In the middle than on the mean (sim/courses/motion.h).
  const sim::Lidar lidar_{{.noise_std = 0.0}, 5.0};
  base::Random noise_{1};
  std::shared_ptr<const sim::Scene> scene_;
  sim::MovingShapes shapes_;
  std::vector<std::uint16_t> ranges_ = std::vector<std::uint16_t>(720);
  env::ObstacleTracker tracker_{{}, kStep};
  double time_ = 0.0;
};

sim::MovingObstacle Cylinder(double radius) {
  sim::MovingObstacle obstacle;
  obstacle.radius = radius;
  return obstacle;
}
sim::MovingObstacle BoxOf(double half_x, double half_y) {
  sim::MovingObstacle obstacle;
  obstacle.half_size = {half_x, half_y};
  return obstacle;
}

TEST_F(OneObstacleTest, IsKnownFromTwoScansAndExactlyFromTen) {
  for (const auto& shape : {Cylinder(0.3), BoxOf(0.4, 0.2), BoxOf(0.15, 0.15)}) {
    for (const base::Vec2 v : {base::Vec2{0.0, 0.5}, {-0.4, 0.6}, {0.3, 0.4}}) {
      for (const double yaw : {0.0, 0.7}) {
        Place({2.5, -1.5}, v, shape, yaw);
        tracker_.Reset();
        Look();
        EXPECT_TRUE(tracker_.tracks().empty()) << "nothing is known of its motion";
        for (int i = 0; i < 9; ++i) Look();
        ASSERT_EQ(tracker_.tracks().size(), 1u);
        const env::Track& track = tracker_.tracks()[0];
        const sim::MovingShape truth = Truth();
        EXPECT_NEAR(track.v_O.x, truth.vx, 0.08) << yaw;
        EXPECT_NEAR(track.v_O.y, truth.vy, 0.08) << yaw;
        EXPECT_NEAR(track.p_O.x, truth.box.x, 0.15);
        EXPECT_NEAR(track.p_O.y, truth.box.y, 0.15);
        EXPECT_GT(track.end_beam, track.first_beam);
      }
    }
  }
}

TEST_F(OneObstacleTest, MovesAndTheRobotDoes) {
  Place({2.5, -1.5}, {0.0, 0.5}, Cylinder(0.3));
  for (int i = 0; i < 10; ++i) Look({{0.1 * i, 0.05 * i}, 0.1 * i});
  ASSERT_EQ(tracker_.tracks().size(), 1u);
  EXPECT_NEAR(tracker_.tracks()[0].v_O.x, Truth().vx, 0.08);
  EXPECT_NEAR(tracker_.tracks()[0].v_O.y, Truth().vy, 0.08);
}

TEST_F(OneObstacleTest, StandsAndTheRobotMoves) {
  for (const auto& shape : {Cylinder(0.3), BoxOf(0.4, 0.2)}) {
    Place({2.5, -0.5}, {0.0, 1e-6}, shape, 0.4);
    tracker_.Reset();
    for (int i = 0; i < 10; ++i) {
      Look({{0.15 * i, 0.05 * i}, 0.1 * i});
      EXPECT_TRUE(tracker_.tracks().empty()) << i;
    }
  }
}

// It goes on as it did while it is hidden, though not for long.
TEST_F(OneObstacleTest, IsHidden) {
  Place({2.5, -1.5}, {0.0, 0.5}, Cylinder(0.3));
  for (int i = 0; i < 10; ++i) Look();
  const env::Track before = tracker_.tracks()[0];
  std::ranges::fill(ranges_, std::uint16_t{500});
  for (int i = 1; i <= 4; ++i) {
    tracker_.Update(ranges_, {});
    ASSERT_EQ(tracker_.tracks().size(), 1u) << i;
    const env::Track& track = tracker_.tracks()[0];
    EXPECT_EQ(track.first_beam, track.end_beam);
    EXPECT_EQ(track.v_O, before.v_O);
    EXPECT_NEAR(track.p_O.y, before.p_O.y + i * kStep * before.v_O.y, 1e-9);
  }
  tracker_.Update(ranges_, {});
  EXPECT_TRUE(tracker_.tracks().empty());
}

TEST(ObstacleTrackerTest, AfterAResetItIsAsAFreshOne) {
  const auto courses = sim::ResolveCourses("generated-crowds:4711:2", std::nullopt, 1).courses;
  ScanWalk first(*courses[0], 1), second(*courses[1], 2);
  env::ObstacleTracker used(first.geometry(), ScanWalk::kStep);
  env::ObstacleTracker fresh(first.geometry(), ScanWalk::kStep);
  while (first.Step()) used.Update(first.ranges_cm(), first.odometry());
  used.Reset();
  std::size_t num_tracks = 0;
  while (second.Step()) {
    used.Update(second.ranges_cm(), second.odometry());
    fresh.Update(second.ranges_cm(), second.odometry());
    ASSERT_TRUE(std::ranges::equal(used.tracks(), fresh.tracks()));
    num_tracks += fresh.tracks().size();
  }
  EXPECT_GT(num_tracks, 20u);
}

}  // namespace
}  // namespace slalom::planners
