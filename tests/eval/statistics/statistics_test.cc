#include "eval/statistics/statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random.h"

namespace slalom::eval {
namespace {

// Published to three decimals in every textbook's table of Student's t, 0.975 quantile.
TEST(StudentCritical, MatchesPublishedTable) {
  EXPECT_NEAR(StudentCritical(1), 12.706, 5e-4);
  EXPECT_NEAR(StudentCritical(2), 4.303, 5e-4);
  EXPECT_NEAR(StudentCritical(3), 3.182, 5e-4);
  EXPECT_NEAR(StudentCritical(10), 2.228, 5e-4);
  EXPECT_NEAR(StudentCritical(29), 2.045, 5e-4);
  EXPECT_NEAR(StudentCritical(120), 1.980, 5e-4);
}

TEST(StudentCritical, ApproachesTheNormalQuantile) {
  // The first term of the Cornish-Fisher series: z + (z^3 + z) / 4n; the next is of order 1 / n^2.
  const double z = kNormalCritical;
  EXPECT_NEAR(StudentCritical(10000), z + (z * z * z + z) / 40000.0, 1e-7);
}

// Newcombe 1998, table I, "score method without continuity correction".
TEST(WilsonInterval, MatchesPublishedValues) {
  const auto expect = [](int hits, int trials, double low, double high) {
    const Interval interval = WilsonInterval(static_cast<double>(hits) / trials, trials);
    EXPECT_NEAR(interval.low, low, 5e-5) << hits << "/" << trials;
    EXPECT_NEAR(interval.high, high, 5e-5) << hits << "/" << trials;
  };
  expect(81, 263, 0.2553, 0.3662);
  expect(15, 148, 0.0624, 0.1605);
  expect(0, 20, 0.0, 0.1611);
  expect(1, 29, 0.0061, 0.1718);
}

TEST(WilsonInterval, TouchesTheEndsExactly) {
  EXPECT_EQ(WilsonInterval(0.0, 10).low, 0.0);
  EXPECT_EQ(WilsonInterval(1.0, 10).high, 1.0);
}

TEST(EstimateRate, OneCourseIsPlainWilson) {
  const std::vector<CourseTotal> courses{{7, 10}};
  const Estimate estimate = EstimateRate(courses);
  EXPECT_EQ(estimate.value, 0.7);
  EXPECT_EQ(estimate.interval, WilsonInterval(0.7, 10));
}

TEST(EstimateRate, AllAlikeCountsEpisodes) {
  const std::vector<CourseTotal> courses(50, {10, 10});
  EXPECT_EQ(EstimateRate(courses).interval, WilsonInterval(1.0, 500, StudentCritical(49)));
}

TEST(EstimateRate, AllOrNothingCoursesCountAsOneTrialEach) {
  // 30 courses always won and 20 always lost: variance p (1 - p) / (K - 1), so 49 trials are left.
  std::vector<CourseTotal> courses(30, {10, 10});
  courses.resize(50, {0, 10});
  const Interval interval = *EstimateRate(courses).interval;
  const Interval expected = WilsonInterval(0.6, 49, StudentCritical(49));
  EXPECT_NEAR(interval.low, expected.low, 1e-12);
  EXPECT_NEAR(interval.high, expected.high, 1e-12);
}

TEST(EstimateRate, CoursesMoreAlikeThanChanceCountNoEpisodeTwice) {
  // Residuals of 0.5: the variance, 10 / 9 * 2.5 / 100^2 = 0.00028, is below that of 100
  // independent episodes, 0.55 * 0.45 / 100 = 0.0025, as if there had been 891.
  std::vector<CourseTotal> courses(5, {5, 10});
  courses.resize(10, {6, 10});
  EXPECT_EQ(EstimateRate(courses).interval, WilsonInterval(0.55, 100, StudentCritical(9)));
}

TEST(EstimateMean, MatchesAHandComputedCase) {
  // Courses of mean 1, 2, 3 with two episodes each: value 2; residuals -2, 0, 2; variance
  // 3/2 * 8 / 36 = 1/3; t(2) = 4.3027.
  const std::vector<CourseTotal> courses{{2, 2}, {4, 2}, {6, 2}, {0, 0}};
  const Estimate estimate = *EstimateMean(courses, {0.0, 100.0});
  EXPECT_DOUBLE_EQ(estimate.value, 2.0);
  EXPECT_EQ(estimate.interval->low, 0.0);  // 2 - 2.48, cut.
  EXPECT_NEAR(estimate.interval->high, 2.0 + 4.30265 * std::sqrt(1.0 / 3.0), 1e-4);
}

TEST(EstimateMean, SaysWhereThereIsNothingToSay) {
  EXPECT_FALSE(EstimateMean(std::vector<CourseTotal>{{0, 0}, {0, 0}}, {0, 80}).has_value());
  const auto one = EstimateMean(std::vector<CourseTotal>{{0, 0}, {12, 3}}, {0, 80});
  EXPECT_EQ(one->value, 4.0);
  EXPECT_FALSE(one->interval.has_value());
}

/// A set of courses whose success probabilities are drawn uniformly from [low, high], 10 episodes
/// each, as hits. With low = high episodes are independent.
std::vector<CourseTotal> DrawHits(base::Random& random, int num_courses, double low, double high) {
  std::vector<CourseTotal> courses;
  for (int c = 0; c < num_courses; ++c) {
    const double probability = random.Uniform(low, high);
    CourseTotal total{0.0, 10.0};
    for (int k = 0; k < 10; ++k) total.sum += random.Uniform() < probability ? 1.0 : 0.0;
    courses.push_back(total);
  }
  return courses;
}

/// The cluster bootstrap, an oracle that needs no formula: standard deviation of the ratio over
/// sets of courses drawn again with replacement.
double BootstrapDeviation(std::span<const CourseTotal> courses, base::Random& random) {
  constexpr int kReplicates = 4000;
  double sum = 0.0;
  double squares = 0.0;
  for (int b = 0; b < kReplicates; ++b) {
    CourseTotal total;
    for (std::size_t k = 0; k < courses.size(); ++k) {
      const CourseTotal& drawn = courses[random.UniformInt(courses.size())];
      total.sum += drawn.sum;
      total.count += drawn.count;
    }
    const double ratio = total.sum / total.count;
    sum += ratio;
    squares += ratio * ratio;
  }
  const double mean = sum / kReplicates;
  return std::sqrt(squares / kReplicates - mean * mean);
}

TEST(EstimateMean, HasTheWidthOfAClusterBootstrap) {
  base::Random random(11);
  for (int trial = 0; trial < 5; ++trial) {
    std::vector<CourseTotal> courses;
    for (int c = 0; c < 60; ++c) {
      const double course_mean = random.Uniform(5.0, 9.0);
      CourseTotal total{0.0, static_cast<double>(4 + random.UniformInt(7))};
      for (int k = 0; k < total.count; ++k) total.sum += course_mean + random.Normal();
      courses.push_back(total);
    }
    const Estimate estimate = *EstimateMean(courses, {0.0, 80.0});
    const double deviation =
        0.5 * (estimate.interval->high - estimate.interval->low) / StudentCritical(59);
    // The bootstrap's own error is 1 / sqrt(2 * 4000) = 1.1 % (4 sigma: 4.5 %), its bias by K
    // against K - 1 is 0.8 %, second-order terms of the ratio are of order 1 / K = 1.7 %.
    EXPECT_NEAR(deviation / BootstrapDeviation(courses, random), 1.0, 0.07);
  }
}

/// Share of simulated evaluations whose interval holds the true rate.
template <class MakeInterval>
double Coverage(int num_sets, int num_courses, double low, double high, MakeInterval make) {
  base::Random random(2024);
  const double truth = 0.5 * (low + high);
  int num_covering = 0;
  for (int s = 0; s < num_sets; ++s) {
    const auto courses = DrawHits(random, num_courses, low, high);
    const Interval interval = make(courses);
    num_covering += interval.low <= truth && truth <= interval.high;
  }
  return static_cast<double>(num_covering) / num_sets;
}

Interval OurInterval(const std::vector<CourseTotal>& courses) {
  return *EstimateRate(courses).interval;
}

Interval NaiveInterval(const std::vector<CourseTotal>& courses) {
  CourseTotal total;
  for (const CourseTotal& course : courses) {
    total.sum += course.sum;
    total.count += course.count;
  }
  return WilsonInterval(total.sum / total.count, total.count);
}

constexpr int kNumSets = 4000;
// Four standard errors of a coverage of 0.95 seen in 4000 sets: 4 * sqrt(0.95 * 0.05 / 4000) =
// 0.0138; one more point is granted to the approximation itself.
constexpr double kLowestCoverage = 0.95 - 0.0138 - 0.01;

TEST(EstimateRate, CoversTheTruth) {
  EXPECT_GE(Coverage(kNumSets, 50, 0.65, 0.65, OurInterval), kLowestCoverage);
  EXPECT_GE(Coverage(kNumSets, 50, 0.3, 1.0, OurInterval), kLowestCoverage);
  EXPECT_GE(Coverage(kNumSets, 50, 0.0, 1.0, OurInterval), kLowestCoverage);
  EXPECT_GE(Coverage(kNumSets, 50, 0.9, 1.0, OurInterval), kLowestCoverage);
  EXPECT_GE(Coverage(kNumSets, 50, 0.98, 1.0, OurInterval), kLowestCoverage);
  EXPECT_GE(Coverage(kNumSets, 10, 0.3, 1.0, OurInterval), kLowestCoverage);
}

TEST(EstimateMean, CoversTheTruth) {
  // Survival times: course means uniform in [5, 9], so 7; few episodes fail, on some courses none.
  base::Random random(7);
  int num_covering = 0;
  for (int s = 0; s < kNumSets; ++s) {
    std::vector<CourseTotal> courses(50);
    for (CourseTotal& course : courses) {
      const double failure_probability = random.Uniform(0.0, 0.5);
      const double course_mean = random.Uniform(5.0, 9.0);
      for (int k = 0; k < 10; ++k) {
        if (random.Uniform() >= failure_probability) continue;
        course.sum += course_mean + random.Normal();
        course.count += 1.0;
      }
    }
    const Interval interval = *EstimateMean(courses, {0.0, 80.0})->interval;
    num_covering += interval.low <= 7.0 && 7.0 <= interval.high;
  }
  EXPECT_GE(static_cast<double>(num_covering) / kNumSets, kLowestCoverage);
  EXPECT_LE(static_cast<double>(num_covering) / kNumSets, 0.95 + 0.0138 + 0.015);
}

TEST(EstimateRate, IsNotNeedlesslyWide) {
  // Where episodes are independent, it must not cover much more than 95 % either.
  EXPECT_LE(Coverage(kNumSets, 50, 0.65, 0.65, OurInterval), 0.95 + 0.0138 + 0.015);
}

TEST(EstimateRate, BeatsTheIntervalThatTakesEpisodesAsIndependent) {
  // The planted wrong interval: with courses as unlike as these it must fall through the same
  // bound.
  EXPECT_LT(Coverage(kNumSets, 50, 0.0, 1.0, NaiveInterval), kLowestCoverage - 0.2);
}

}  // namespace
}  // namespace slalom::eval
