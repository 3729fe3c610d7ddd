#pragma once

#include "sim/courses/course.h"

namespace slalom::sim {

/// Counts the courses of `scored` that have the same obstacles, fixed and moving, as a course of
/// `trained`, in any order. Names, starts, goals, paths and bounds do not count: a score on the
/// obstacles that a policy was trained on is no test.
int CountSharedCourses(const CourseSet& scored, const CourseSet& trained);

}  // namespace slalom::sim
