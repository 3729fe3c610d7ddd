#pragma once

#include "sim/courses/course.h"

namespace slalom::sim {

/// How many courses of `scored` have the obstacles of a course of `trained`, fixed and moving ones,
/// in whichever order they stand. Names, starts, goals, paths and bounds do not count: where the
/// obstacles are those of a course that was trained on, a score is no test, whatever it is called.
int CountSharedCourses(const CourseSet& scored, const CourseSet& trained);

}  // namespace slalom::sim
