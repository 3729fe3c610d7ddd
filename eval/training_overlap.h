#pragma once

#include <string>

namespace slalom::eval {

/// Counts the courses on which a policy is scored and was also trained. A value.
struct TrainingOverlap {
  int num_courses = 0;     ///< Scored courses that were trained on, too.
  int num_scored = 0;      ///< Scored courses.
  std::string trained_on;  ///< The set that it was trained on, as its config names it.

  friend bool operator==(const TrainingOverlap&, const TrainingOverlap&) = default;
};

/// "40 of the 50 courses are among those that the policy was trained on (static-train-250): ...", a
/// sentence for warnings. Requires: num_courses > 0.
std::string DescribeOverlap(const TrainingOverlap& overlap);

}  // namespace slalom::eval
