#include "eval/report/paired_comparison.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace slalom::eval {
namespace {

constexpr double kOptimalTime = 5.0;  // [s]

/// A course on which `times` are those of successful episodes and `num_failures` more collided.
ResultCourse Course(const std::vector<double>& times, int num_failures) {
  ResultCourse course{"course", kOptimalTime, {}};
  for (const double time : times) course.episodes.push_back({env::Outcome::kSuccess, time, 0});
  for (int k = 0; k < num_failures; ++k) {
    course.episodes.push_back({env::Outcome::kCollision, 1.0, 1});
  }
  return course;
}

Result MakeResult(std::vector<ResultCourse> courses) {
  Result result;
  result.courses = std::move(courses);
  result.seed = 1;
  return result;
}

TEST(CompareInPairs, IsStudentsIntervalOfTheDifferencesOfCourses) {
  // Success 1, 1, 0.5 against 0.5, 1, 0: differences 0.5, 0, 0.5, whose mean is 1/3 and whose
  // standard error is sqrt((1/36 + 1/9 + 1/36) / 2 / 3) = 1/6; Student's quantile for two degrees
  // of freedom is 4.302653, so the lower end is 1/3 - 0.717109 and the upper one beyond 1.
  const Result first =
      MakeResult({Course({10.0, 10.0}, 0), Course({20.0, 20.0}, 0), Course({8}, 1)});
  const Result second = MakeResult({Course({16.0}, 1), Course({21.0, 25.0}, 0), Course({}, 2)});
  const PairedComparison pair = CompareInPairs(first, second);
  EXPECT_NEAR(pair.success_rate.value, 1.0 / 3.0, 1e-12);
  ASSERT_TRUE(pair.success_rate.interval);
  EXPECT_NEAR(pair.success_rate.interval->low, 1.0 / 3.0 - 4.302652730 / 6.0, 1e-7);
  EXPECT_EQ(pair.success_rate.interval->high, 1.0);
  // All failures are collisions.
  EXPECT_NEAR(pair.collision_rate.value, -1.0 / 3.0, 1e-12);
  EXPECT_NEAR(pair.collision_rate.interval->high, -1.0 / 3.0 + 4.302652730 / 6.0, 1e-7);
  EXPECT_EQ(pair.timeout_rate.value, 0.0);
  // Times differ by -6 and -3 on the two courses that both passed; the error is 1.5, the quantile
  // for one degree of freedom 12.706205.
  EXPECT_EQ(pair.num_traversal_courses, 2);
  ASSERT_TRUE(pair.traversal_time && pair.traversal_time->interval);
  EXPECT_NEAR(pair.traversal_time->value, -4.5, 1e-12);
  EXPECT_NEAR(pair.traversal_time->interval->high, -4.5 + 12.706204736 * 1.5, 1e-6);
  // Scores of a course are means of OT / clip(AT, 2 OT, 8 OT): 0.5, 0.25, 0.25 against
  // 5 / 16 / 2, (5 / 21 + 5 / 25) / 2, 0.
  const double expected = ((0.5 - 0.15625) + (0.25 - (5.0 / 21.0 + 0.2) / 2.0) + 0.25) / 3.0;
  EXPECT_NEAR(pair.barn_score.value, expected, 1e-12);
  EXPECT_TRUE(pair.same_starts);
}

TEST(CompareInPairs, TurnedRoundHasTheOppositeSigns) {
  const Result first = MakeResult({Course({10.0, 11.0}, 1), Course({20.0}, 2), Course({9.0}, 2)});
  const Result second = MakeResult({Course({16.0}, 2), Course({21.0, 25.0}, 1), Course({}, 3)});
  const PairedComparison there = CompareInPairs(first, second);
  const PairedComparison back = CompareInPairs(second, first);
  EXPECT_EQ(there.success_rate.value, -back.success_rate.value);
  EXPECT_NEAR(there.success_rate.interval->low, -back.success_rate.interval->high, 1e-12);
  EXPECT_NEAR(there.barn_score.interval->high, -back.barn_score.interval->low, 1e-12);
  EXPECT_EQ(there.traversal_time->value, -back.traversal_time->value);
}

TEST(CompareInPairs, ClaimsNoIntervalWhereAllCoursesAgree) {
  const Result perfect = MakeResult({Course({10.0}, 0), Course({10.0}, 0)});
  EXPECT_FALSE(CompareInPairs(perfect, perfect).success_rate.interval);
  const Result one = MakeResult({Course({10.0}, 0)});
  EXPECT_FALSE(CompareInPairs(one, MakeResult({Course({}, 1)})).success_rate.interval);
  EXPECT_FALSE(CompareInPairs(one, MakeResult({Course({}, 1)})).traversal_time);
}

TEST(CompareInPairs, EpisodesBeginAlikeWithOneSeedAndEquallyMany) {
  const Result first = MakeResult({Course({10.0}, 1)});
  Result second = first;
  EXPECT_TRUE(CompareInPairs(first, second).same_starts);
  second.seed = 2;
  EXPECT_FALSE(CompareInPairs(first, second).same_starts);
  EXPECT_FALSE(CompareInPairs(first, MakeResult({Course({10.0}, 2)})).same_starts);
}

}  // namespace
}  // namespace slalom::eval
