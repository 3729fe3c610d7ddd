#include "train/run_config.h"

#include "sim/course_sets.h"

namespace slalom::train {

sim::CourseSet CoursesConfig::Resolve(const std::string& spec) const {
  return sim::ResolveCourses(spec, collection, static_cast<std::uint64_t>(generator_seed));
}

}  // namespace slalom::train
