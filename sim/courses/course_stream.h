#pragma once

#include <cstdint>

#include "base/config_field.h"
#include "sim/courses/course.h"

namespace slalom::sim {

/// Which generator makes the fresh courses of a training.
enum class FreshCourses { kNone, kStatic, kBox, kWall };
inline base::OneOf EnumNames(FreshCourses) { return {"none", "static", "box", "wall"}; }

/// Returns course `number` of the endless stream of `seed`, named "stream-SEED-NUMBER".
///
/// It is a function of (kind, seed, number) alone, bit for bit, and like the courses of
/// `GenerateFreshCourses` and its counterparts for moving obstacles. No set that `ResolveCourses`
/// makes has a course of a stream, whatever the seeds, so a score on generated courses is a score
/// on unseen ones.
///
/// Requires: kind is not kNone, number >= 0. Cost: 0.7 ms for a static course on average, 0.1 ms
/// for the others.
Course GenerateStreamCourse(FreshCourses kind, std::uint64_t seed, int number);

}  // namespace slalom::sim
