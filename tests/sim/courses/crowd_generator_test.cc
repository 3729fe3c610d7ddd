#include "sim/courses/crowd_generator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "base/file.h"
#include "base/random.h"
#include "sim/courses/course_check.h"
#include "sim/courses/course_file.h"
#include "sim/courses/foresight.h"
#include "sim/courses/motion.h"

namespace slalom::sim {
namespace {

using testing::Each;
using testing::Ge;
using testing::Le;

constexpr int kNumCrowds = 150;

const CourseSet& Crowds() {
  static const CourseSet set = GenerateFreshCrowdCourses(3, kNumCrowds);
  return set;
}

double DistanceToGoal(const Course& course) { return base::Norm(course.goal_W - course.start.p); }

/// Angle between the start's heading and the goal, [rad].
double Slant(const Course& course) {
  const base::Vec2 p = base::InverseTransform(course.start, course.goal_W);
  return std::abs(std::atan2(p.y, p.x));
}

TEST(CrowdGenerator, EveryCrowdCanBeDrivenAndStaysWithinTheRecipe) {
  const CrowdRecipe recipe;
  for (const auto& course : Crowds().courses) {
    EXPECT_EQ(WhyUnsolvable(*course), std::nullopt) << course->name;
    EXPECT_TRUE(course->circles.empty() && course->reference_path_W.empty());
    EXPECT_LE(course->boxes.size(), 4u);
    EXPECT_GE(course->moving.size(), 2u);
    EXPECT_LE(course->moving.size(), 24u);
    for (const MovingObstacle& obstacle : course->moving) {
      const Motion motion(obstacle);
      EXPECT_GT(motion.max_speed(), 0.0);
      const double reach = obstacle.radius > 0.0 ? obstacle.radius : base::Norm(obstacle.half_size);
      EXPECT_LE(reach, recipe.max_radius * std::sqrt(2.0));
      for (int i = 0; i <= 200; ++i) {
        const base::Vec2 p = motion.At(motion.period() * i / 200).X_WB.p;
        // Between its points the spline swings out a little.
        EXPECT_GE(std::min({p.x - course->bounds.min_W.x, course->bounds.max_W.x - p.x,
                            p.y - course->bounds.min_W.y, course->bounds.max_W.y - p.y}),
                  -1.0)
            << course->name;
      }
    }
  }
}

TEST(CrowdGenerator, TheStraightWayIsClearOfWalls) {
  for (const auto& course : Crowds().courses) {
    for (int i = 0; i <= 100; ++i) {
      const base::Vec2 p = course->start.p + 0.01 * i * (course->goal_W - course->start.p);
      for (const Box& wall : course->boxes) EXPECT_GT(DistanceTo(wall, p), 0.5) << course->name;
    }
  }
}

TEST(CrowdGenerator, GoalsAreAtAnyDistanceAndInAnyDirection) {
  std::vector<double> distances, slants;
  for (const auto& course : Crowds().courses) {
    distances.push_back(DistanceToGoal(*course));
    slants.push_back(Slant(*course));
  }
  EXPECT_THAT(distances, Each(Ge(2.0)));
  EXPECT_THAT(distances, Each(Le(30.0)));
  const auto share = [](const std::vector<double>& values, double low, double high) {
    return std::ranges::count_if(values, [&](double v) { return low <= v && v < high; }) /
           static_cast<double>(values.size());
  };
  EXPECT_GT(share(distances, 2.0, 5.0), 0.1);
  EXPECT_GT(share(distances, 5.0, 10.0), 0.2);
  EXPECT_GT(share(distances, 15.0, 30.0), 0.1);
  // Half face the goal; of the others 0.35 / pi do by chance: 0.556 in all, and a sixth of 0.444
  // look more than 5 pi / 6 away, 0.074. Five standard errors of 150 draws are 0.20 and 0.11.
  EXPECT_NEAR(share(slants, 0.0, 0.35), 0.556, 0.20);
  EXPECT_NEAR(share(slants, 5.0 * base::kPi / 6.0, 4.0), 0.074, 0.11);
}

/// Share of motion times, other ones than the generator tests, from which the disc arrives.
double ArrivalShare(const CourseSet& set) {
  base::Random random(11);
  int num_arrivals = 0, num_starts = 0;
  for (const auto& course : set.courses) {
    const Foresight foresight(*course);
    for (int i = 0; i < 10; ++i) {
      const double motion_time = random.Uniform(0.0, 1000.0);
      if (!foresight.IsStartClear(motion_time)) continue;
      ++num_starts;
      num_arrivals += foresight.EarliestArrival(motion_time).has_value() ? 1 : 0;
    }
  }
  EXPECT_GT(num_starts, 5 * static_cast<int>(set.courses.size()));
  return num_arrivals / static_cast<double>(num_starts);
}

TEST(CrowdGenerator, CrowdsCanBeCrossedFromMotionTimesThatWereNotTested) {
  EXPECT_GT(ArrivalShare(Crowds()), 0.98);
  // Dense, fast and small: drawn once, such crowds let the disc arrive from 10 of 67 times.
  CrowdRecipe dense;
  dense.max_side = 6.0;
  dense.min_obstacles = dense.least_max_obstacles = 24;
  dense.min_speed = 1.5;
  CourseSet set{"dense", {}};
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    set.courses.push_back(
        std::make_shared<const Course>(GenerateCrowdCourse("dense", dense, seed)));
  }
  EXPECT_GT(ArrivalShare(set), 0.75);
}

TEST(CrowdGenerator, CourseDependsOnSeedAndIndexAlone) {
  const CourseSet all = GenerateFreshCrowdCourses(5, 9);
  EXPECT_EQ(*all.courses[3], *GenerateFreshCrowdCourses(5, 4).courses[3]);
  EXPECT_EQ(all.courses[3]->name, "fresh-crowds-5-003");
  EXPECT_NE(all.courses[0]->moving, all.courses[1]->moving);
  EXPECT_NE(all.courses[0]->moving, GenerateFreshCrowdCourses(6, 1).courses[0]->moving);
}

// The same bits in every build, on every machine, for good: results name courses by seed and index.
TEST(CrowdGenerator, CoursesNeverChange) {
  EXPECT_EQ(base::Checksum(PrintCourseSet(GenerateFreshCrowdCourses(1, 20))),
            14669665027794437452ull);
  EXPECT_EQ(base::Checksum(PrintCourseSet(GenerateFreshCylinderCourses(1, 20))),
            17573921706522714921ull);
}

TEST(CrowdGenerator, CylindersMoveBetweenStartAndAGoalAtTheOtherSide) {
  const CourseSet set = GenerateFreshCylinderCourses(3, 30);
  for (const auto& course : set.courses) {
    EXPECT_EQ(WhyUnsolvable(*course), std::nullopt) << course->name;
    EXPECT_GE(course->moving.size(), 8u);
    for (const MovingObstacle& obstacle : course->moving) EXPECT_EQ(obstacle.radius, 0.5);
    // At most 1.5 m inside or 1 m outside either side, and anywhere along it.
    EXPECT_GE(DistanceToGoal(*course), 17.0);
    EXPECT_LE(DistanceToGoal(*course), std::hypot(22.0, 20.0));
    EXPECT_LE(Slant(*course), 0.36);
  }
  EXPECT_GT(ArrivalShare(set), 0.98);
}

TEST(CrowdGenerator, ACourseFileHoldsACrowd) {
  const CourseSet some = GenerateFreshCrowdCourses(2, 3);
  const CourseSet read = ParseCourseSet(PrintCourseSet(some), "x", ".");
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(*read.courses[i], *some.courses[i]);
}

}  // namespace
}  // namespace slalom::sim
