#include "sim/courses/real_world_courses.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "base/file.h"
#include "sim/courses/course_check.h"
#include "sim/courses/course_file.h"
#include "tests/support/path_points.h"

namespace slalom::sim {
namespace {

/// Distance from `p_W` to the nearest obstacle; 0 or less where one holds the point.
double ClearanceAt(const Course& course, base::Vec2 p_W) {
  double nearest = 1e9;
  for (const Circle& c : course.circles) {
    nearest = std::min(nearest, base::Norm(p_W - c.p_W) - c.radius);
  }
  for (const Box& box : course.boxes) {
    const base::Vec2 p = base::InverseTransform(box.X_WB, p_W);
    const base::Vec2 nearest_inside = {std::clamp(p.x, -box.half_size.x, box.half_size.x),
                                       std::clamp(p.y, -box.half_size.y, box.half_size.y)};
    nearest = std::min(nearest, base::Norm(p - nearest_inside));
  }
  return nearest;
}

TEST(RealWorldCourses, RobotFitsThroughAllAlongTheReferencePath) {
  // Corners of an outline of 0.46 m x 0.42 m are 0.311 m from its centre.
  for (int number = 1; number <= kNumRealWorldCourses; ++number) {
    const Course course = RealWorldCourse(number);
    EXPECT_EQ(WhyUnsolvable(course), std::nullopt);
    const std::vector<base::Vec2> way = test::PathPoints(course, 0.01);
    const base::Vec2 worst = *std::min_element(way.begin(), way.end(), [&](auto a, auto b) {
      return ClearanceAt(course, a) < ClearanceAt(course, b);
    });
    EXPECT_GE(ClearanceAt(course, worst), 0.32)
        << course.name << " at " << worst.x << ", " << worst.y;
  }
}

TEST(RealWorldCourses, StraightLineIsBarredInEach) {
  for (int number = 1; number <= kNumRealWorldCourses; ++number) {
    Course course = RealWorldCourse(number);
    course.reference_path_W.clear();
    const std::vector<base::Vec2> line = test::PathPoints(course, 0.01);
    EXPECT_TRUE(std::any_of(line.begin(), line.end(), [&](base::Vec2 p) {
      return ClearanceAt(course, p) < 0.5 * kRobotWidth;
    })) << course.name;
  }
}

TEST(RealWorldCourses, LengthsAreThoseOfTheHeader) {
  const double straight[] = {6.0, 7.58, 30.0};
  const double paths[] = {7.351, 8.565, 32.398};
  for (int number = 1; number <= kNumRealWorldCourses; ++number) {
    const Course course = RealWorldCourse(number);
    EXPECT_EQ(course.start, base::Pose2());
    EXPECT_NEAR(base::Norm(course.goal_W), straight[number - 1], 0.005);
    EXPECT_NEAR(ReferenceLength(course), paths[number - 1], 0.001);
  }
}

TEST(RealWorldCourses, NeverChange) {
  CourseSet set{"real", {}};
  for (int number = 1; number <= kNumRealWorldCourses; ++number) {
    set.courses.push_back(std::make_shared<const Course>(RealWorldCourse(number)));
  }
  EXPECT_EQ(base::Checksum(PrintCourseSet(set)), 15552648574829723462ull);
}

}  // namespace
}  // namespace slalom::sim
