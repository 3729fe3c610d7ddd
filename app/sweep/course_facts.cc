#include "app/sweep/course_facts.h"

#include <fmt/format.h>

#include "app/train/run_identity.h"
#include "sim/courses/course_file.h"
#include "sim/courses/course_sets.h"

namespace slalom::sweep {

const CourseFacts& CourseFactsCache::Find(const std::string& collection,
                                          std::int64_t generator_seed, const std::string& spec) {
  const std::string key = fmt::format("{}\n{}\n{}", collection, generator_seed, spec);
  auto found = facts_.find(key);
  if (found == facts_.end()) {
    sim::CourseSet set =
        sim::ResolveCourses(spec, collection, static_cast<std::uint64_t>(generator_seed));
    set.name = "courses";  // What a set is called is not what it is.
    found = facts_
                .emplace(key, CourseFacts{static_cast<int>(set.courses.size()),
                                          train::Digest(sim::PrintCourseSet(set))})
                .first;
  }
  return found->second;
}

}  // namespace slalom::sweep
