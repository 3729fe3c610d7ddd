#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "eval/report/result.h"
#include "eval/report/result_group.h"
#include "eval/statistics/statistics.h"
#include "sim/courses/course.h"

namespace slalom::eval {

/// A measure of how hard courses are, with its value for each course.
struct CourseMeasure {
  std::string_view key;   ///< Unique.
  std::string_view name;  ///< For people.
  std::string_view unit;
  std::vector<double> values;  ///< One per course.
};

/// Returns the measures that differ between the courses: the measures of `sim::Difficulty` if every
/// course has them, the length of the reference path, the number of obstacles, and
/// `sim::MotionMeasures`.
std::vector<CourseMeasure> MeasureCourses(const sim::CourseSet& courses);

/// Courses with similar values of a measure.
struct CourseBin {
  double low = 0.0;  ///< Smallest and largest value in it.
  double high = 0.0;
  std::vector<std::size_t> courses;
};

/// Sorts the courses by the measure and splits them into at most five bins whose sizes differ by at
/// most one. Each bin has at least four courses; fewer than eight courses make no bins.
std::vector<CourseBin> BinCourses(const CourseMeasure& measure);

/// Returns the success rate of an agent on the courses of a bin (`BootstrapShare`).
Estimate SuccessInBin(std::span<const Result> results, const AgentResults& agent,
                      const CourseBin& bin);

}  // namespace slalom::eval
