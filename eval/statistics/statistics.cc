#include "eval/statistics/statistics.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/geometry.h"

namespace slalom::eval {
namespace {

/// P(|T| < t) for Student's T with `degrees` degrees of freedom: the finite sums of Abramowitz and
/// Stegun 26.7.3 and 26.7.4.
double CentralStudentProbability(double t, int degrees) {
  const double theta = std::atan(t / std::sqrt(static_cast<double>(degrees)));
  const double cosine = std::cos(theta);
  const bool odd = degrees % 2 == 1;
  if (degrees == 1) return 2.0 * theta / base::kPi;
  double term = odd ? cosine : 1.0;
  double sum = term;
  for (int k = odd ? 3 : 2; k <= degrees - 2; k += 2) {
    term *= cosine * cosine * (k - 1) / k;
    sum += term;
  }
  sum *= std::sin(theta);
  return odd ? 2.0 / base::kPi * (theta + sum) : sum;
}

struct Ratio {
  double value = 0.0;
  double count = 0.0;     ///< Episodes.
  double variance = 0.0;  ///< Variance of the value; 0 with fewer than two courses.
  int num_courses = 0;    ///< Courses with at least one episode.
};

Ratio LinearisedRatio(std::span<const CourseTotal> courses) {
  Ratio ratio;
  double sum = 0.0;
  for (const CourseTotal& course : courses) {
    sum += course.sum;
    ratio.count += course.count;
    if (course.count > 0.0) ++ratio.num_courses;
  }
  if (ratio.num_courses == 0) return ratio;
  ratio.value = sum / ratio.count;
  if (ratio.num_courses == 1) return ratio;
  double squares = 0.0;
  for (const CourseTotal& course : courses) {
    const double residual = course.sum - ratio.value * course.count;
    squares += residual * residual;
  }
  const double k = ratio.num_courses;
  ratio.variance = k / (k - 1.0) * squares / (ratio.count * ratio.count);
  return ratio;
}

}  // namespace

double StudentCritical(int degrees_of_freedom) {
  SLALOM_CHECK_GE(degrees_of_freedom, 1);
  double low = 1.0;
  double high = 13.0;  // Above the largest, 12.71 with one degree of freedom.
  while (high - low > 1e-10) {
    const double middle = 0.5 * (low + high);
    (CentralStudentProbability(middle, degrees_of_freedom) < 0.95 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

Interval WilsonInterval(double proportion, double num_trials, double critical) {
  SLALOM_CHECK_GE(proportion, 0.0);
  SLALOM_CHECK_LE(proportion, 1.0);
  SLALOM_CHECK_GT(num_trials, 0.0);
  const double c2 = critical * critical;
  const double centre = (proportion + c2 / (2.0 * num_trials)) / (1.0 + c2 / num_trials);
  const double half_width = critical / (1.0 + c2 / num_trials) *
                            std::sqrt(proportion * (1.0 - proportion) / num_trials +
                                      c2 / (4.0 * num_trials * num_trials));
  // Rounding alone may carry an end past the proportion, when that is 0 or 1.
  return {std::clamp(centre - half_width, 0.0, proportion),
          std::clamp(centre + half_width, proportion, 1.0)};
}

Estimate EstimateRate(std::span<const CourseTotal> courses) {
  const Ratio ratio = LinearisedRatio(courses);
  SLALOM_CHECK_GT(ratio.count, 0.0);
  if (ratio.num_courses == 1) return {ratio.value, WilsonInterval(ratio.value, ratio.count)};
  double effective = ratio.count;
  if (ratio.variance > 0.0) {
    effective = std::min(effective, ratio.value * (1.0 - ratio.value) / ratio.variance);
  }
  return {ratio.value,
          WilsonInterval(ratio.value, effective, StudentCritical(ratio.num_courses - 1))};
}

std::optional<Estimate> EstimateMean(std::span<const CourseTotal> courses, Interval limits) {
  const Ratio ratio = LinearisedRatio(courses);
  if (ratio.num_courses == 0) return std::nullopt;
  Estimate estimate{ratio.value, std::nullopt};
  if (ratio.num_courses > 1) {
    const double half_width = StudentCritical(ratio.num_courses - 1) * std::sqrt(ratio.variance);
    estimate.interval = Interval{std::max(limits.low, ratio.value - half_width),
                                 std::min(limits.high, ratio.value + half_width)};
  }
  return estimate;
}

}  // namespace slalom::eval
