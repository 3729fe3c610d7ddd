#pragma once

#include <optional>
#include <span>

/// Estimates from a finite number of episodes, with 95 % intervals.
///
/// Episodes on one course resemble each other, so the random unit is the course, not the episode:
/// the intervals of a set are valid for other courses of the same kind. docs/evaluation.md has the
/// formulas and the simulated coverage.

namespace slalom::eval {

/// A closed interval.
struct Interval {
  double low = 0.0;
  double high = 0.0;

  friend bool operator==(const Interval&, const Interval&) = default;
};

/// An estimate and its 95 % interval, if the data can give one (a single course cannot).
struct Estimate {
  double value = 0.0;
  std::optional<Interval> interval;
};

/// The totals of one course: the `sum` of a quantity over `count` episodes.
struct CourseTotal {
  double sum = 0.0;
  double count = 0.0;
};

/// The 0.975 quantile of the standard normal distribution.
inline constexpr double kNormalCritical = 1.959963984540054;

/// Returns the 0.975 quantile of Student's t distribution, exact to 1e-9.
/// Requires: degrees_of_freedom >= 1.
double StudentCritical(int degrees_of_freedom);

/// Returns Wilson's score interval for a proportion observed in `num_trials` independent trials,
/// which may be an effective (fractional) number. Requires: 0 <= proportion <= 1, num_trials > 0.
Interval WilsonInterval(double proportion, double num_trials, double critical = kNormalCritical);

/// Estimates a rate over a set of K courses by Wilson's interval with Student's quantile for K - 1
/// degrees of freedom. The effective number of episodes follows from the spread between courses and
/// never exceeds the real one. With one course, or if all episodes had the same outcome, episodes
/// count as independent.
///
/// `sum` is the number of hits.
/// Requires: at least one episode, 0 <= sum <= count for each course.
Estimate EstimateRate(std::span<const CourseTotal> courses);

/// Estimates a mean over the episodes of a set of courses: the ratio estimator with its linearised
/// variance between courses and Student's quantile, clipped to `limits`. Courses without such an
/// episode do not count. Returns nothing if there is no episode at all.
std::optional<Estimate> EstimateMean(std::span<const CourseTotal> courses, Interval limits);

}  // namespace slalom::eval
