#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace slalom::sweep {

/// The facts about a course set that a cell's identity needs.
struct CourseFacts {
  int num_courses = 0;
  std::string digest;  ///< Digest of the courses themselves, not of their place or the set's name.
};

/// Reads each course set once. Thread-compatible.
class CourseFactsCache {
 public:
  /// The set that `spec` names. Throws `base::Error` like `sim::ResolveCourses`.
  const CourseFacts& Find(const std::string& collection, std::int64_t generator_seed,
                          const std::string& spec);

 private:
  std::map<std::string, CourseFacts> facts_;
};

}  // namespace slalom::sweep
