#include "eval/statistics/bootstrap.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/random.h"
#include "eval/statistics/statistics.h"

namespace slalom::eval {
namespace {

/// Scores of simulated agents. The success probability of a course is uniform from 0.3 to 0.7, that
/// of a policy is higher or lower on all courses, and episodes are drawn.
struct Simulation {
  std::size_t num_seeds = 5;
  std::size_t num_courses = 40;
  double seed_deviation = 0.05;
  int num_episodes = 10;

  static constexpr double kTruth = 0.5;

  std::vector<double> DrawCourses(base::Random& random) const {
    std::vector<double> courses;
    for (std::size_t c = 0; c < num_courses; ++c) courses.push_back(random.Uniform(0.3, 0.7));
    return courses;
  }

  ScoreTable Draw(base::Random& random, const std::vector<double>& courses) const {
    ScoreTable table{"simulated", {}, {0.0, 1.0}};
    for (std::size_t s = 0; s < num_seeds; ++s) {
      const double shift = seed_deviation * random.Normal();
      auto& row = table.scores.emplace_back();
      for (const double course : courses) {
        int hits = 0;
        for (int e = 0; e < num_episodes; ++e) hits += random.Uniform() < course + shift;
        row.push_back(static_cast<double>(hits) / num_episodes);
      }
    }
    return table;
  }
};

constexpr int kNumStudies = 1000;
constexpr BootstrapOptions kFew{.num_samples = 400};

bool Covers(const Estimate& estimate, double truth) {
  return estimate.interval && estimate.interval->low <= truth && truth <= estimate.interval->high;
}

/// The share of studies for which `make_interval(random)` covers the truth.
template <class Study>
double Coverage(Study study) {
  base::Random random(31);
  int num_covering = 0;
  for (int k = 0; k < kNumStudies; ++k) num_covering += study(random);
  return static_cast<double>(num_covering) / kNumStudies;
}

double CoverageOfMean(const Simulation& simulation) {
  return Coverage([&](base::Random& random) {
    const auto table = simulation.Draw(random, simulation.DrawCourses(random));
    return Covers(BootstrapMean(table, kFew), Simulation::kTruth);
  });
}

// Four standard errors of a coverage of 0.95 seen in 1000 studies are 4 sqrt(0.95 * 0.05 / 1000) =
// 0.028. Below, one more point is granted to the approximation. Above, two more points: drawing
// courses and seeds at once counts the noise of episodes up to three times (Owen 2007).
constexpr double kLowest = 0.95 - 0.028 - 0.01;
constexpr double kHighest = 0.95 + 0.028 + 0.02;

TEST(BootstrapMean, CoversTheTruthWhateverVaries) {
  for (const Simulation& simulation :
       {Simulation{.num_seeds = 1, .seed_deviation = 0.0}, Simulation{.num_seeds = 5},
        Simulation{.num_seeds = 3, .seed_deviation = 0.08},
        Simulation{.num_seeds = 5, .num_courses = 100, .seed_deviation = 0.08},
        Simulation{.num_seeds = 10, .num_courses = 12, .seed_deviation = 0.02}}) {
    const double coverage = CoverageOfMean(simulation);
    EXPECT_GE(coverage, kLowest) << simulation.num_seeds << " seeds";
    EXPECT_LE(coverage, kHighest) << simulation.num_seeds << " seeds";
  }
}

// The planted faults: what forgets that seeds or courses differ falls far through the same bound.
TEST(BootstrapMean, DrawingOneLevelAloneIsNotEnough) {
  const Simulation simulation{.num_seeds = 5, .seed_deviation = 0.08};
  const double courses_alone = Coverage([&](base::Random& random) {
    const auto table = simulation.Draw(random, simulation.DrawCourses(random));
    ScoreTable averaged{"", {std::vector<double>(table.num_courses())}, {0.0, 1.0}};
    for (const auto& row : table.scores) {
      for (std::size_t c = 0; c < row.size(); ++c) averaged.scores[0][c] += row[c] / 5.0;
    }
    return Covers(BootstrapMean(averaged, kFew), Simulation::kTruth);
  });
  EXPECT_LT(courses_alone, kLowest - 0.1);
}

TEST(BootstrapDifference, CoversTheTruth) {
  const Simulation simulation{.num_seeds = 4};
  const double coverage = Coverage([&](base::Random& random) {
    const auto courses = simulation.DrawCourses(random);
    const auto first = simulation.Draw(random, courses);
    const auto second = simulation.Draw(random, courses);
    return Covers(BootstrapDifference(first, second, kFew), 0.0);
  });
  EXPECT_GE(coverage, kLowest);
  // Here the noise of episodes is most of the spread that is left, and it is counted more than
  // once.
  EXPECT_LE(coverage, 1.0);
}

ScoreTable SomeTable(std::uint64_t seed, std::size_t num_seeds = 4) {
  base::Random random(seed);
  const Simulation simulation{.num_seeds = num_seeds};
  return simulation.Draw(random, simulation.DrawCourses(random));
}

TEST(Bootstrap, TurnedRoundHasTheOppositeSigns) {
  // Single seeds: those of two agents are drawn from streams of their own.
  const ScoreTable first = SomeTable(1, 1);
  const ScoreTable second = SomeTable(2, 1);
  const Estimate there = BootstrapDifference(first, second);
  const Estimate back = BootstrapDifference(second, first);
  EXPECT_NEAR(there.value, -back.value, 1e-12);
  EXPECT_NEAR(there.interval->low, -back.interval->high, 1e-12);
  EXPECT_NEAR(there.interval->high, -back.interval->low, 1e-12);
  const Estimate better = BootstrapProbabilityOfImprovement(first, second);
  const Estimate worse = BootstrapProbabilityOfImprovement(second, first);
  EXPECT_NEAR(better.value, 1.0 - worse.value, 1e-12);
  EXPECT_NEAR(better.interval->low, 1.0 - worse.interval->high, 1e-12);
}

// Courses are alike, so the interval is Student's for the means of the seeds, which resamples of so
// few would make too narrow: by 13 % for four. A resample's quantiles lie on a grid, hence 6 %.
TEST(Bootstrap, OfFewSeedsIsAsWideAsStudents) {
  ScoreTable table{"agent", {}, {-10.0, 10.0}};
  double mean = 0.0, squares = 0.0;
  for (const double score : {0.3, 0.4, 0.55, 0.6}) {
    table.scores.push_back({score, score, score});
    mean += score / 4.0;
    squares += score * score;
  }
  const double deviation = std::sqrt((squares - 4.0 * mean * mean) / 3.0);
  const Interval interval = *BootstrapMean(table).interval;
  const double expected = 2.0 * StudentCritical(3) * deviation / 2.0;
  EXPECT_NEAR(interval.high - interval.low, expected, 0.06 * expected);
}

TEST(Bootstrap, IsTheSameEveryTimeForASeed) {
  const ScoreTable table = SomeTable(1);
  const Estimate once = BootstrapMean(table, {.num_samples = 500, .seed = 3});
  const Estimate again = BootstrapMean(table, {.num_samples = 500, .seed = 3});
  const Estimate other = BootstrapMean(table, {.num_samples = 500, .seed = 4});
  EXPECT_EQ(once.interval, again.interval);
  EXPECT_NE(once.interval, other.interval);
}

// Courses and the seeds of each agent are drawn independently, so their variances add up. Where two
// factors of n spread alike, an interval is sqrt(2) as wide as where one does, apart from the
// stretch, which has 2 (n - 1) degrees of freedom in place of n - 1. Drawn from one stream, two
// factors whose effects are opposite would cancel each other in every resample: width 0.
TEST(Bootstrap, DrawsCoursesAndEachAgentsSeedsIndependently) {
  constexpr int kNum = 8;
  ScoreTable by_seed{"by seed", {}, {-100.0, 100.0}}, by_both = by_seed;
  for (int s = 0; s < kNum; ++s) {
    by_seed.scores.emplace_back(kNum, s);
    auto& row = by_both.scores.emplace_back();
    for (int c = 0; c < kNum; ++c) row.push_back(s - c);
  }
  const BootstrapOptions many{.num_samples = 20000};
  const auto width = [](const Estimate& estimate) {
    return estimate.interval.value().high - estimate.interval.value().low;
  };
  const double expected = std::sqrt(2.0) * StudentCritical(2 * (kNum - 1)) /
                          StudentCritical(kNum - 1) * width(BootstrapMean(by_seed, many));
  // A quantile at 2.5 % of 20000 normal draws has a standard error of sqrt(0.025 * 0.975 / 20000) /
  // 0.0584 = 0.019 deviations. A width of 3.92 deviations has two of them, and two widths are
  // compared: 1 %. Four, and one more per cent as means of 8 and of 16 draws are nearly normal.
  EXPECT_NEAR(width(BootstrapDifference(by_seed, by_seed, many)), expected, 0.05 * expected);
  EXPECT_NEAR(width(BootstrapMean(by_both, many)), expected, 0.05 * expected);
}

/// The share of all pairs of policies and courses on which the first scores higher; half of draws.
double ProbabilityOfImprovement(const ScoreTable& first, const ScoreTable& second) {
  double wins = 0.0;
  double count = 0.0;
  for (const std::vector<double>& a : first.scores) {
    for (const std::vector<double>& b : second.scores) {
      for (std::size_t c = 0; c < a.size(); ++c, ++count)
        wins += 0.5 * ((a[c] > b[c]) + (a[c] >= b[c]));
    }
  }
  return wins / count;
}

TEST(Bootstrap, ValuesAreThoseWithoutIntervals) {
  const ScoreTable first = SomeTable(1);
  const ScoreTable second = SomeTable(2, 3);
  EXPECT_NEAR(BootstrapMean(first).value, Mean(first), 1e-12);
  EXPECT_NEAR(BootstrapInterquartileMean(first).value, InterquartileMean(first), 1e-12);
  EXPECT_NEAR(BootstrapLowestTwentiethMean(first).value, LowestTwentiethMean(first), 1e-12);
  EXPECT_NEAR(BootstrapDifference(first, second).value, Mean(first) - Mean(second), 1e-12);
  EXPECT_NEAR(BootstrapProbabilityOfImprovement(first, second).value,
              ProbabilityOfImprovement(first, second), 1e-12);
}

TEST(Bootstrap, TheLowestTwentiethIsOfAllSeedsAndCourses) {
  // 42 scores 0.00, 0.01 ... 0.41 in any order: the three lowest.
  ScoreTable table{"forty-two", {{}, {}}, {0.0, 1.0}};
  for (int i = 0; i < 42; ++i) table.scores[i % 2].push_back(0.01 * ((i * 11) % 42));
  EXPECT_NEAR(LowestTwentiethMean(table), 0.01, 1e-12);
  const Estimate estimate = BootstrapLowestTwentiethMean(table);
  ASSERT_TRUE(estimate.interval);
  EXPECT_LT(estimate.interval->high, Mean(table));
}

TEST(Bootstrap, StaysWithinWhatIsPossible) {
  ScoreTable table = SomeTable(1, 2);
  for (auto& row : table.scores) std::ranges::fill(row, 1.0);
  table.scores[0][0] = 0.0;
  const Estimate estimate = BootstrapMean(table);
  ASSERT_TRUE(estimate.interval);
  EXPECT_LE(estimate.interval->high, 1.0);
  EXPECT_LE(estimate.interval->low, estimate.value);
  EXPECT_GE(estimate.interval->high, estimate.value);
}

TEST(Bootstrap, ClaimsNoIntervalWhereTheSpreadIsUnknown) {
  const ScoreTable one_course{"one", {{0.4}, {0.7}, {0.9}}, {0.0, 1.0}};
  EXPECT_FALSE(BootstrapMean(one_course).interval);
  EXPECT_FALSE(BootstrapDifference(one_course, one_course).interval);
  const ScoreTable alike{"alike", {{0.3, 0.3, 0.3}, {0.3, 0.3, 0.3}}, {0.0, 1.0}};
  EXPECT_FALSE(BootstrapMean(alike).interval);
  EXPECT_EQ(BootstrapProbabilityOfImprovement(alike, alike).value, 0.5);
  EXPECT_FALSE(BootstrapProbabilityOfImprovement(alike, alike).interval);
}

TEST(BootstrapRatio, SaysWhereThereIsNothingToSay) {
  const double infinity = std::numeric_limits<double>::infinity();
  const ScoreTable none{"none", {{0.0, 0.0}, {0.0, 0.0}}, {0.0, infinity}};
  EXPECT_FALSE(BootstrapRatio({none, none}));
  // One course alone was passed: leaving it out leaves nothing.
  const ScoreTable sums{"one", {{12.0, 0.0}, {16.0, 0.0}}, {0.0, infinity}};
  const ScoreTable counts{"one", {{2.0, 0.0}, {2.0, 0.0}}, {0.0, infinity}};
  const auto estimate = BootstrapRatio({sums, counts});
  ASSERT_TRUE(estimate);
  EXPECT_EQ(estimate->value, 7.0);
  EXPECT_FALSE(estimate->interval);
}

/// One seed's ratio of which both parts vary from course to course.
RatioTables SomeRatio(std::uint64_t seed, const std::vector<double>& courses) {
  base::Random random(seed);
  const Simulation simulation{.num_seeds = 1, .num_courses = courses.size(), .num_episodes = 100};
  RatioTables tables{simulation.Draw(random, courses), {}};
  tables.counts = tables.sums;
  tables.sums.limits = {0.0, std::numeric_limits<double>::infinity()};
  for (std::size_t c = 0; c < courses.size(); ++c) {
    tables.counts.scores[0][c] = 1.0 + static_cast<double>(random.UniformInt(9));
    tables.sums.scores[0][c] *= tables.counts.scores[0][c];
  }
  return tables;
}

TEST(BootstrapRatioDifference, OfMeansIsTheirDifference) {
  const ScoreTable first = SomeTable(1);
  const ScoreTable second = SomeTable(2);
  const auto with_ones = [](const ScoreTable& table) {
    RatioTables tables{table, table};
    for (auto& row : tables.counts.scores) std::ranges::fill(row, 1.0);
    return tables;
  };
  const Estimate expected = BootstrapDifference(first, second);
  const auto estimate = BootstrapRatioDifference(with_ones(first), with_ones(second), true);
  ASSERT_TRUE(estimate && estimate->interval);
  EXPECT_NEAR(estimate->value, expected.value, 1e-12);
  EXPECT_NEAR(estimate->interval->low, expected.interval->low, 1e-12);
  EXPECT_NEAR(estimate->interval->high, expected.interval->high, 1e-12);
}

TEST(BootstrapRatioDifference, CoursesOfTheirOwnAddTheirSpread) {
  base::Random random(5);
  const std::vector<double> courses = Simulation{}.DrawCourses(random);
  const RatioTables first = SomeRatio(1, courses);
  const RatioTables second = SomeRatio(2, courses);
  const auto width = [](const std::optional<Estimate>& estimate) {
    return estimate->interval->high - estimate->interval->low;
  };
  const double together = width(BootstrapRatioDifference(first, second, true));
  const double apart = width(BootstrapRatioDifference(first, second, false));
  const double alone = std::hypot(width(BootstrapRatio(first)), width(BootstrapRatio(second)));
  // Variances of independent estimates add up. Widths of 2000 resamples deviate by 2 %.
  EXPECT_NEAR(apart, alone, 0.12 * alone);
  EXPECT_LT(together, 0.9 * apart);
}

TEST(ScoreTableDeathTest, TablesThatAreNoneAreOurMistake) {
  EXPECT_DEATH(Mean({"ragged", {{0.1, 0.2}, {0.3}}, {}}), "num_courses");
  EXPECT_DEATH(Mean({"empty", {}, {}}), "empty");
  EXPECT_DEATH(Mean({"nan", {{std::numeric_limits<double>::quiet_NaN()}}, {}}), "isfinite");
  EXPECT_DEATH(BootstrapProbabilityOfImprovement({"a", {{0.1}}, {}}, {"b", {{0.1, 0.2}}, {}}),
               "num_courses");
  EXPECT_DEATH(AreaUnderCurve(std::vector{0.0, 0.0}, std::vector{0.0, 1.0}), "check failed");
}

}  // namespace
}  // namespace slalom::eval
