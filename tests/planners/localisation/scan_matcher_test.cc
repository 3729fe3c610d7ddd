#include "planners/localisation/scan_matcher.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "sim/courses/course_sets.h"
#include "sim/courses/real_world_courses.h"
#include "tests/support/scan_walk.h"

namespace slalom::planners {
namespace {

using test::ScanWalk;

double Apart(const base::Pose2& a, const base::Pose2& b) { return base::Norm(a.p - b.p); }

/// Walks to the goal. Returns all poses that the matcher found.
std::vector<base::Pose2> MatchAll(ScanWalk& walk, ScanMatcher& matcher) {
  std::vector<base::Pose2> found;
  while (walk.Step()) found.push_back(matcher.Match(walk.ranges_cm(), walk.odometry()));
  return found;
}

/// Mean errors at the goal, [m].
struct Errors {
  double odometry = 0.0, matched = 0.0;
};

Errors ErrorsOn(const sim::Course& course, int num_walks, int num_beams = 720) {
  Errors errors;
  for (int seed = 0; seed < num_walks; ++seed) {
    ScanWalk walk(course, seed, num_beams);
    ScanMatcher matcher(walk.geometry());
    const base::Pose2 matched = MatchAll(walk, matcher).back();
    errors.odometry += Apart(walk.odometry(), walk.truth()) / num_walks;
    errors.matched += Apart(matched, walk.truth()) / num_walks;
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
  Errors sum;
  for (const auto& course :
       sim::ResolveCourses("generated-crowds:4711:8", std::nullopt, 1).courses) {
    ASSERT_FALSE(course->moving.empty());
    const Errors errors = ErrorsOn(*course, 4);
    sum.odometry += errors.odometry;
    sum.matched += errors.matched;
  }
  EXPECT_LT(sum.matched, 0.7 * sum.odometry);
}

TEST(ScanMatcherTest, AlongABareWallOdometryCounts) {
  sim::Course corridor;
  corridor.name = "corridor";
  corridor.goal_W = {10.0, 0.0};
  corridor.bounds = {{-20.0, -2.0}, {40.0, 2.0}};
  for (const double y : {-1.5, 1.5}) corridor.boxes.push_back({{{10.0, y}, 0.0}, {29.0, 0.1}});
  ScanWalk walk(corridor, 3, 720, {.position_drift = 0.05, .heading_drift = 0.01});
  ScanMatcher matcher(walk.geometry());
  const base::Pose2 matched = MatchAll(walk, matcher).back();
  EXPECT_GT(std::abs(walk.odometry().p.y), 0.1);
  EXPECT_NEAR(matched.p.y, 0.0, 0.02);
  EXPECT_NEAR(matched.yaw, 0.0, 0.01);
  EXPECT_NEAR(matched.p.x, walk.odometry().p.x, 0.1);
}

TEST(ScanMatcherTest, SeesNothingAndBelievesTheOdometry) {
  ScanMatcher matcher({.num_beams = 10});
  const std::vector<std::uint16_t> nothing(10, 500), contact(10, 0);
  for (const base::Pose2& pose :
       {base::Pose2{{1.0, 2.0}, 3.0}, {{2.0, 2.5}, -3.0}, {{-40.0, 9.0}, 1.0}}) {
    for (const auto& ranges : {nothing, contact}) {
      const base::Pose2 found = matcher.Match(ranges, pose);
      EXPECT_NEAR(Apart(found, pose), 0.0, 1e-9);
      EXPECT_NEAR(base::WrapAngle(found.yaw - pose.yaw), 0.0, 1e-9);
    }
  }
}

TEST(ScanMatcherTest, ResetForgetsAll) {
  ScanMatcher fresh({}), used({});
  const auto match = [](ScanMatcher& matcher, std::uint64_t seed) {
    ScanWalk walk(sim::RealWorldCourse(2), seed);
    return MatchAll(walk, matcher);
  };
  match(used, 1);
  used.Reset();
  EXPECT_EQ(match(used, 2), match(fresh, 2));
}

}  // namespace
}  // namespace slalom::planners
