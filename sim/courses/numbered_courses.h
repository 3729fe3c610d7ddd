#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "sim/courses/course.h"

namespace slalom::sim {

/// Makes course `number` with this name. `seed`: the course's own.
using MakeNumberedCourse = std::function<Course(std::string name, int number, std::uint64_t seed)>;

/// Courses [first, first + count) of a seed's stream, in a set "STREAM-SEED". Course i is named
/// "STREAM-SEED-i", with three digits at least, and its own seed is a function of (seed, stream,
/// i). Requires: first >= 0, count >= 0.
CourseSet MakeNumberedCourses(const std::string& stream, std::uint64_t seed, int first, int count,
                              const MakeNumberedCourse& make);

}  // namespace slalom::sim
