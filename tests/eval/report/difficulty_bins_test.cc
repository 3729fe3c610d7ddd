#include "eval/report/difficulty_bins.h"

#include <gtest/gtest.h>

#include <memory>
#include <set>

namespace slalom::eval {
namespace {

sim::CourseSet MakeCourses(int n, bool with_difficulty) {
  sim::CourseSet set{"made", {}};
  for (int c = 0; c < n; ++c) {
    sim::Course course;
    course.name = std::to_string(c);
    course.goal_W = {10.0, 0.0};
    course.circles.resize(static_cast<std::size_t>(c));
    if (with_difficulty) course.difficulty = sim::Difficulty{7.0 - c, 1.0, 2.0, 3.0, 1.0 + c};
    set.courses.push_back(std::make_shared<const sim::Course>(std::move(course)));
  }
  return set;
}

std::vector<std::string> Keys(const std::vector<CourseMeasure>& measures) {
  std::vector<std::string> keys;
  for (const CourseMeasure& measure : measures) keys.emplace_back(measure.key);
  return keys;
}

TEST(MeasureCourses, LeavesOutWhatDoesNotTellCoursesApart) {
  // All are 10 m long; three of the five measures are the same everywhere.
  EXPECT_EQ(Keys(MeasureCourses(MakeCourses(8, true))),
            (std::vector<std::string>{"distance", "tortuosity", "obstacles"}));
  EXPECT_EQ(Keys(MeasureCourses(MakeCourses(8, false))), std::vector<std::string>{"obstacles"});
  EXPECT_TRUE(MeasureCourses(MakeCourses(1, true)).empty());
}

TEST(MeasureCourses, MeasuresWhatMoves) {
  sim::CourseSet set{"made", {}};
  for (const double period : {2.0, 4.0}) {
    sim::Course course;
    course.goal_W = {10.0, 0.0};
    course.bounds = {{0.0, 0.0}, {10.0, 5.0}};
    course.moving.resize(1);
    course.moving[0].key_frames = {{0.0, {}}, {period, {{8.0, 0.0}, 0.0}}};
    set.courses.push_back(std::make_shared<const sim::Course>(std::move(course)));
  }
  const std::vector<CourseMeasure> measures = MeasureCourses(set);
  EXPECT_EQ(Keys(measures), std::vector<std::string>{"speed"}) << "both have 2 on 100 m^2";
  EXPECT_EQ(measures[0].values, (std::vector<double>{4.0, 2.0}));
}

TEST(BinCourses, CutsTheOrderIntoEqualParts) {
  const CourseMeasure measure{"m", "m", "", {5, 1, 4, 2, 3, 9, 8, 7, 6, 0}};
  const std::vector<CourseBin> bins = BinCourses(measure);
  ASSERT_EQ(bins.size(), 2u);
  EXPECT_EQ(bins[0].courses, (std::vector<std::size_t>{9, 1, 3, 4, 2}));
  EXPECT_EQ(bins[1].courses, (std::vector<std::size_t>{0, 8, 7, 6, 5}));
  EXPECT_EQ(bins[0].low, 0.0);
  EXPECT_EQ(bins[0].high, 4.0);
  EXPECT_EQ(bins[1].low, 5.0);
  EXPECT_TRUE(BinCourses({"m", "m", "", {1, 2, 3, 4, 5, 6, 7}}).empty());
}

TEST(BinCourses, HoldsEachCourseOnce) {
  for (const int n : {8, 50, 299, 300}) {
    CourseMeasure measure{"m", "m", "", {}};
    for (int c = 0; c < n; ++c) measure.values.push_back((c * 37) % 11);
    std::set<std::size_t> seen;
    std::size_t num_courses = 0;
    for (const CourseBin& bin : BinCourses(measure)) {
      seen.insert(bin.courses.begin(), bin.courses.end());
      num_courses += bin.courses.size();
      EXPECT_GE(bin.courses.size(), 4u);
    }
    EXPECT_EQ(seen.size(), static_cast<std::size_t>(n));
    EXPECT_EQ(num_courses, static_cast<std::size_t>(n));
  }
}

TEST(SuccessInBin, CountsTheEpisodesOfItsCoursesAlone) {
  std::vector<Result> results(2);
  Result& result = results[0];
  result.courses.resize(3);
  using enum env::Outcome;
  result.courses[0].episodes = {{kSuccess, 1.0, 0}, {kCollision, 1.0, 1}};
  result.courses[1].episodes = {{kTimeout, 1.0, 0}, {kTimeout, 1.0, 0}};
  result.courses[2].episodes = {{kSuccess, 1.0, 0}, {kSuccess, 1.0, 0}};
  results[1] = result;
  results[1].courses[1] = result.courses[0];
  EXPECT_DOUBLE_EQ(SuccessInBin(results, {"a", {0}}, {0.0, 0.0, {0, 2}}).value, 0.75);
  EXPECT_DOUBLE_EQ(SuccessInBin(results, {"a", {0}}, {0.0, 0.0, {1}}).value, 0.0);
  EXPECT_DOUBLE_EQ(SuccessInBin(results, {"a", {0, 1}}, {0.0, 0.0, {1}}).value, 0.25);
}

}  // namespace
}  // namespace slalom::eval
