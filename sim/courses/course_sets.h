#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/courses/course.h"

namespace slalom::sim {

/// The course set that `spec` names:
///
/// - a name of `SplitNames()`, such as "static-train-50" or "dynamic-box-test": of the collection
///   where one is given (a directory that `slalom courses import` wrote: the set NAME is its file
///   NAME.courses, and any other set file in it has a name too), else of the built-in collections
///   of `GenerateStaticCourses`, `GenerateBoxCourses` and `GenerateWallCourses` of
///   `generator_seed`;
/// - "real-world-1", "-2", "-3": the one `RealWorldCourse`, with or without a collection;
/// - "generated:SEED:COUNT", "generated-box:SEED:COUNT", "generated-wall:SEED:COUNT": fresh courses
///   of `GenerateFreshCourses` and its like, with or without a collection;
/// - else a path: a course or course-set file, or a directory whose *.course and *.courses files,
///   by name, are the set.
///
/// Without a collection, "static-validation" is 40 fresh courses of `generator_seed`, so it is
/// unseen by what trains on any of the sets; with one, see `SplitNames`. An empty `collection` path
/// counts as none.
///
/// Throws `Error` that names spec, file and line where there is no such set (listing those there
/// are), a file is damaged, the set is empty, or a course of it cannot be driven (`WhyUnsolvable`).
CourseSet ResolveCourses(const std::string& spec,
                         const std::optional<std::filesystem::path>& collection,
                         std::uint64_t generator_seed);

/// The patterns of fresh courses for people: "generated:SEED:COUNT, generated-box:SEED:COUNT, ...".
std::string FreshCoursePatterns();

/// The names that `ResolveCourses` knows without a path, in a sensible order.
std::vector<std::string> ListCourseSets(const std::optional<std::filesystem::path>& collection);

}  // namespace slalom::sim
