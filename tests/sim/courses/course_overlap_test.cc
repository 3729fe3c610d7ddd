#include "sim/courses/course_overlap.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "sim/courses/course_generator.h"
#include "sim/courses/course_sets.h"
#include "sim/courses/dynamic_generator.h"

namespace slalom::sim {
namespace {

CourseSet SetOf(std::vector<Course> courses) {
  CourseSet set{"made", {}};
  for (Course& course : courses) {
    set.courses.push_back(std::make_shared<const Course>(std::move(course)));
  }
  return set;
}

TEST(CountSharedCourses, CountsScoredCoursesByTheirObstacles) {
  const CourseSet trained = GenerateFreshCourses(5, 4);
  EXPECT_EQ(CountSharedCourses(trained, trained), 4);
  EXPECT_EQ(CountSharedCourses(GenerateFreshCourses(6, 4), trained), 0);
  EXPECT_EQ(CountSharedCourses({"none", {}}, trained), 0);
  EXPECT_EQ(CountSharedCourses(trained, {"none", {}}), 0);

  // Another name, start, goal, path, and order of obstacles: the same obstacles all the same.
  Course copy = *trained.courses[2];
  copy.name = "renamed";
  copy.start.p.y += 0.25;
  copy.goal_W.x -= 0.25;
  copy.reference_path_W.clear();
  copy.difficulty.reset();
  std::ranges::reverse(copy.circles);
  Course moved = *trained.courses[1];
  moved.circles[0].p_W.x += 0.01;
  Course less = *trained.courses[1];
  less.circles.pop_back();
  EXPECT_EQ(CountSharedCourses(SetOf({copy, copy, moved, less}), trained), 2)
      << "each scored course counts, also one that stands twice";
}

TEST(CountSharedCourses, SeesBoxesAndWhatMoves) {
  const CourseSet walls = GenerateWallCourses(1, 0, 3);  // Their fixed cylinders are all the same.
  EXPECT_EQ(CountSharedCourses(GenerateWallCourses(1, 2, 4), walls), 1);
  const CourseSet boxes = GenerateBoxCourses(1, 0, 3);
  EXPECT_EQ(CountSharedCourses(GenerateBoxCourses(1, 1, 5), boxes), 2);
  Course course = *boxes.courses[0];
  course.boxes.front().half_size.x += 0.01;
  Course minus_zero = *boxes.courses[0];
  for (Box& box : minus_zero.boxes) {
    if (box.X_WB.yaw == 0.0) box.X_WB.yaw = -0.0;
  }
  EXPECT_EQ(CountSharedCourses(SetOf({course, minus_zero}), boxes), 1);
}

TEST(CountSharedCourses, FortyOfTheChallengesCoursesAreInTheLargestTrainingSet) {
  const auto count = [](const char* scored, const char* trained) {
    return CountSharedCourses(ResolveCourses(scored, std::nullopt, 1),
                              ResolveCourses(trained, std::nullopt, 1));
  };
  EXPECT_EQ(count("static-challenge", "static-train-250"), 40);
  EXPECT_EQ(count("static-challenge", "static-train-no-challenge"), 0);
  EXPECT_EQ(count("static-test", "static-train-250"), 0);
}

}  // namespace
}  // namespace slalom::sim
