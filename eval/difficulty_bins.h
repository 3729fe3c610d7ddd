#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "eval/result.h"
#include "eval/statistics.h"
#include "sim/course.h"

namespace slalom::eval {

/// Something that makes courses harder or easier.
struct CourseMeasure {
  std::string_view key;   ///< Unique.
  std::string_view name;  ///< For people.
  std::string_view unit;
  std::vector<double> values;  ///< One per course.
};

/// The measures that tell the courses apart: those of `sim::Difficulty` where every course has
/// them, the length of the reference path, the number of obstacles.
std::vector<CourseMeasure> MeasureCourses(const sim::CourseSet& courses);

/// Courses that are alike in a measure.
struct CourseBin {
  double low = 0.0;  ///< Smallest and largest value in it.
  double high = 0.0;
  std::vector<std::size_t> courses;
};

/// The courses in order of the measure, cut into at most five parts of equal size (within one), of
/// at least four courses each. Fewer than eight courses make no bins.
std::vector<CourseBin> BinCourses(const CourseMeasure& measure);

/// Success rate on the courses of a bin (`EstimateRate`).
Estimate SuccessInBin(const Result& result, const CourseBin& bin);

}  // namespace slalom::eval
