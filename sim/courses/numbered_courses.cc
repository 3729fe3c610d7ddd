#include "sim/courses/numbered_courses.h"

#include <fmt/format.h>

#include <memory>

#include "base/check.h"
#include "base/random.h"

namespace slalom::sim {

CourseSet MakeNumberedCourses(const std::string& stream, std::uint64_t seed, int first, int count,
                              const MakeNumberedCourse& make) {
  SLALOM_CHECK_GE(first, 0);
  SLALOM_CHECK_GE(count, 0);
  CourseSet set{fmt::format("{}-{}", stream, seed), {}};
  for (int i = first; i < first + count; ++i) {
    const std::uint64_t own =
        base::DeriveSeed(seed, stream + "-course", {static_cast<std::uint64_t>(i)});
    set.courses.push_back(
        std::make_shared<const Course>(make(fmt::format("{}-{}-{:03}", stream, seed, i), i, own)));
  }
  return set;
}

}  // namespace slalom::sim
