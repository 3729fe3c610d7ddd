#pragma once

#include <optional>
#include <span>

/// What a finite number of episodes says about a policy, with 95 % intervals.
///
/// Episodes on one course resemble each other, so a course, not an episode, is the unit drawn at
/// random: the intervals of a set hold for further courses of the same kind. docs/evaluation.md has
/// the formulas and the simulated coverage.

namespace slalom::eval {

/// A closed interval.
struct Interval {
  double low = 0.0;
  double high = 0.0;

  friend bool operator==(const Interval&, const Interval&) = default;
};

/// A figure with its 95 % interval; none where the data cannot give one (a single course).
struct Estimate {
  double value = 0.0;
  std::optional<Interval> interval;
};

/// What the episodes of one course add up to: `sum` of the quantity over `count` episodes.
struct CourseTotal {
  double sum = 0.0;
  double count = 0.0;
};

/// The 0.975 quantile of the standard normal distribution.
inline constexpr double kNormalCritical = 1.959963984540054;

/// The 0.975 quantile of Student's t distribution, within 1e-9.
/// Requires: degrees_of_freedom >= 1.
double StudentCritical(int degrees_of_freedom);

/// Wilson's score interval of a proportion seen in `num_trials` independent trials; `num_trials`
/// may be an effective number.
/// Requires: 0 <= proportion <= 1, num_trials > 0.
Interval WilsonInterval(double proportion, double num_trials, double critical = kNormalCritical);

/// A rate over a set of courses: Wilson's interval with the effective number of episodes that the
/// spread between courses leaves (never more than there are) and Student's quantile for K - 1
/// degrees of freedom. With one course, or where every episode went the same way, episodes count as
/// independent.
///
/// `sum` holds the number of hits.
/// Requires: at least one episode, 0 <= sum <= count for each course.
Estimate EstimateRate(std::span<const CourseTotal> courses);

/// A mean over the episodes of a set of courses: ratio estimator with its linearised variance
/// between courses and Student's quantile, cut to `limits`. Courses without such an episode do not
/// count. None: no episode at all.
std::optional<Estimate> EstimateMean(std::span<const CourseTotal> courses, Interval limits);

}  // namespace slalom::eval
