#include "eval/training_overlap.h"

#include <fmt/format.h>

#include "base/check.h"

namespace slalom::eval {

std::string DescribeOverlap(const TrainingOverlap& overlap) {
  SLALOM_CHECK(overlap.num_courses > 0);
  return fmt::format(
      "{} of the {} courses {} among those that the policy was trained on ({}): there the score "
      "says what it remembers, not how it drives on new courses",
      overlap.num_courses, overlap.num_scored, overlap.num_courses == 1 ? "is" : "are",
      overlap.trained_on);
}

}  // namespace slalom::eval
