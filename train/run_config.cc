#include "train/run_config.h"

#include "base/file.h"
#include "config/config.h"
#include "sim/course_sets.h"

namespace slalom::train {

sim::CourseSet CoursesConfig::Resolve(const std::string& spec) const {
  return sim::ResolveCourses(spec, collection, static_cast<std::uint64_t>(generator_seed));
}

std::uint64_t SpecHash(const RunConfig& config) {
  return base::Checksum(config::ToToml(config.environment),
                        base::Checksum(config::ToToml(config.network)));
}

}  // namespace slalom::train
