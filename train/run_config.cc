#include "train/run_config.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/file.h"
#include "config/config.h"
#include "learner/algorithm.h"
#include "sim/course_sets.h"
#include "sim/scene.h"

namespace slalom::train {

sim::CourseSet CoursesConfig::Resolve(const std::string& spec) const {
  return sim::ResolveCourses(spec, collection, static_cast<std::uint64_t>(generator_seed));
}

policy::PolicySpec MakePolicySpec(const RunConfig& config) {
  return {.observation = sim::MakeObservationSpec(config.environment),
          .network = config.network,
          .actions = config.environment.action,
          .distribution = learner::DistributionOf(config.method.learner)};
}

void RequireCombination(const RunConfig& config) {
  if (config.method.constraint.kind != "none" && !config.environment.episode.collision_ends) {
    throw base::Error(fmt::format(
        "constraint.kind is \"{}\", expected \"none\" where environment.episode.collision_ends is "
        "false: the constraint counts episodes that a collision ended",
        config.method.constraint.kind));
  }
}

std::uint64_t SpecHash(const RunConfig& config) {
  return base::Checksum(config::ToToml(config.environment),
                        base::Checksum(config::ToToml(config.network),
                                       base::Checksum(config.method.learner.algorithm)));
}

}  // namespace slalom::train
