#include "planners/localisation/scan_matcher.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "base/random.h"
#include "sim/courses/course.h"
#include "sim/courses/course_sets.h"
#include "sim/courses/real_world_courses.h"
#include "sim/lidar.h"
#include "sim/localisation.h"
#include "sim/scene.h"

namespace slalom::planners {
namespace {

constexpr double kClip = 5.0;

/// As configs/real-robot.toml.
constexpr sim::LocalisationConfig kDrift = {
    .position_drift = 0.02, .heading_drift = 0.003, .turn_drift = 0.01};

double Apart(const base::Pose2& a, const base::Pose2& b) { return base::Norm(a.p - b.p); }

/// Poses a step of `step` [m] apart along the points, that turn by at most 0.3 rad a step.
std::vector<base::Pose2> Walk(base::Pose2 pose, const std::vector<base::Vec2>& points,
                              double step) {
  std::vector<base::Pose2> poses = {pose};
  base::Vec2 from = pose.p;
  for (const base::Vec2 to : points) {
    const base::Vec2 way = to - from;
    const double length = base::Norm(way), heading = std::atan2(way.y, way.x);
    for (double s = step; s < length; s += step) {
      const double turn = std::clamp(base::WrapAngle(heading - pose.yaw), -0.3, 0.3);
      pose = {from + (s / length) * way, base::WrapAngle(pose.yaw + turn)};
      poses.push_back(pose);
    }
    from = to;
  }
  return poses;
}

/// What a robot senses on a walk with a noisy range finder and an odometry that drifts.
class Senses {
 public:
  Senses(const sim::Course& course, const sim::LocalisationConfig& drift, std::uint64_t seed,
         int num_beams = 720)
      : scene_(sim::MakeScene(std::make_shared<sim::Course>(course))),
        lidar_(ConfigOf(num_beams), kClip),
        ranges_cm_(static_cast<std::size_t>(num_beams)),
        noise_(seed),
        localisation_(drift) {
    localisation_.Reset(course.start, seed);
  }

  ScanGeometry geometry() const {
    return {.num_beams = lidar_.num_beams(), .p_RS = lidar_.mounting(), .clip = kClip};
  }

  /// The robot is at X_WR now, and obstacles have moved for `time` [s]. Returns where `matcher`
  /// says that it is.
  base::Pose2 Match(ScanMatcher& matcher, const base::Pose2& X_WR, double time = 0.0) {
    localisation_.Advance(X_WR, 0.0);
    scene_->moving_obstacles().PlaceAll(time, moving_);
    lidar_.Scan(scene_->collision_map(), X_WR, noise_, ranges_cm_, &moving_);
    return matcher.Match(ranges_cm_, odometry());
  }

  const base::Pose2& odometry() const { return localisation_.X_OR(); }

 private:
  static sim::LidarConfig ConfigOf(int num_beams) {
    return {.num_beams = num_beams,
            .noise_std = 0.02,
            .noise_per_metre = 0.002,
            .dropout_probability = 0.01};
  }

  const std::shared_ptr<const sim::Scene> scene_;
  const sim::Lidar lidar_;
  std::vector<std::uint16_t> ranges_cm_;
  sim::MovingShapes moving_;
  base::Random noise_;
  sim::Localisation localisation_;
};

/// Mean errors at the end of walks, [m].
struct Errors {
  double odometry = 0.0, matched = 0.0;
};

Errors ErrorsOn(const sim::Course& course, int num_walks, int num_beams = 720) {
  std::vector<base::Vec2> points = course.reference_path_W;
  points.push_back(course.goal_W);
  Errors errors;
  for (int seed = 0; seed < num_walks; ++seed) {
    Senses senses(course, kDrift, seed, num_beams);
    ScanMatcher matcher(senses.geometry());
    base::Pose2 truth, matched;
    double time = 0.0;
    for (const base::Pose2& X_WR : Walk(course.start, points, 0.25)) {
      matched = senses.Match(matcher, X_WR, time += 0.2);
      truth = {base::InverseTransform(course.start, X_WR.p),
               base::WrapAngle(X_WR.yaw - course.start.yaw)};
    }
    errors.odometry += Apart(senses.odometry(), truth) / num_walks;
    errors.matched += Apart(matched, truth) / num_walks;
  }
  return errors;
}

TEST(ScanMatcherTest, KnowsTheEndOfALongHall) {
  const Errors errors = ErrorsOn(sim::RealWorldCourse(3), 8);
  EXPECT_GT(errors.odometry, 0.3);
  EXPECT_LT(errors.matched, 0.12);
}

TEST(ScanMatcherTest, KnowsItWithAnotherRangeFinder) {
  const Errors errors = ErrorsOn(sim::RealWorldCourse(3), 8, 270);
  EXPECT_LT(errors.matched, 0.4 * errors.odometry);
}

TEST(ScanMatcherTest, KnowsItAmongCrowds) {
  double odometry = 0.0, matched = 0.0;
  for (const auto& course :
       sim::ResolveCourses("generated-crowds:4711:8", std::nullopt, 1).courses) {
    ASSERT_FALSE(course->moving.empty());
    const Errors errors = ErrorsOn(*course, 4);
    odometry += errors.odometry;
    matched += errors.matched;
  }
  EXPECT_LT(matched, odometry);
}

TEST(ScanMatcherTest, AlongABareWallOdometryCounts) {
  sim::Course corridor;
  corridor.name = "corridor";
  corridor.goal_W = {10.0, 0.0};
  corridor.bounds = {{-20.0, -2.0}, {40.0, 2.0}};
  for (const double y : {-1.5, 1.5}) corridor.boxes.push_back({{{10.0, y}, 0.0}, {29.0, 0.1}});
  Senses senses(corridor, {.position_drift = 0.05, .heading_drift = 0.01}, 3);
  ScanMatcher matcher(senses.geometry());
  base::Pose2 truth, matched;
  for (const base::Pose2& X_WR : Walk({}, {corridor.goal_W}, 0.25)) {
    truth = X_WR;
    matched = senses.Match(matcher, X_WR);
  }
  EXPECT_GT(std::abs(senses.odometry().p.y), 0.1);
  EXPECT_NEAR(matched.p.y, truth.p.y, 0.02);
  EXPECT_NEAR(matched.yaw, truth.yaw, 0.01);
  EXPECT_NEAR(matched.p.x, senses.odometry().p.x, 0.1);
}

TEST(ScanMatcherTest, SeesNothingAndBelievesTheOdometry) {
  ScanMatcher matcher({.num_beams = 10});
  const std::vector<std::uint16_t> nothing(10, 500), contact(10, 0);
  for (const base::Pose2& pose : {base::Pose2{{1.0, 2.0}, 3.0}, base::Pose2{{2.0, 2.5}, -3.0},
                                  base::Pose2{{-40.0, 9.0}, 1.0}}) {
    for (const auto& ranges : {nothing, contact}) {
      const base::Pose2 found = matcher.Match(ranges, pose);
      EXPECT_NEAR(Apart(found, pose), 0.0, 1e-9);
      EXPECT_NEAR(base::WrapAngle(found.yaw - pose.yaw), 0.0, 1e-9);
    }
  }
}

TEST(ScanMatcherTest, ResetForgetsAll) {
  const sim::Course course = sim::RealWorldCourse(2);
  const auto walk = [&](ScanMatcher& matcher, std::uint64_t seed) {
    Senses senses(course, kDrift, seed);
    std::vector<base::Pose2> found;
    for (const base::Pose2& X_WR : Walk(course.start, course.reference_path_W, 0.3)) {
      found.push_back(senses.Match(matcher, X_WR));
    }
    return found;
  };
  ScanMatcher fresh({}), used({});
  walk(used, 1);
  used.Reset();
  EXPECT_EQ(walk(used, 2), walk(fresh, 2));
}

}  // namespace
}  // namespace slalom::planners
