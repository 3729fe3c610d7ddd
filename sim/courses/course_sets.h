#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/courses/course.h"
#include "sim/courses/course_stream.h"

namespace slalom::sim {

/// Returns the course set that `spec` names, which is one of these:
///
/// - a name of `SplitNames()`, such as "static-train-50" or "dynamic-box-test". If a collection is
///   given (a directory that `slalom courses import` wrote), the set NAME is its file NAME.courses,
///   and so for any other set file in it. Otherwise the set is of the built-in collections of
///   `GenerateStaticCourses`, `GenerateBoxCourses` and `GenerateWallCourses` with `generator_seed`;
/// - "real-world-1", "-2", "-3": the one `RealWorldCourse`, with or without a collection;
/// - "generated:SEED:COUNT", "generated-box:SEED:COUNT", "generated-wall:SEED:COUNT",
///   "generated-crowds:SEED:COUNT", "generated-halls:SEED:COUNT", "generated-rooms:SEED:COUNT":
///   fresh courses of `GenerateFreshCourses` and its like, with or without a collection;
/// - a path to a course or course-set file, or to a directory whose *.course and *.courses files,
///   ordered by name, are the set;
/// - several of these joined by "+", unless there is a file of the whole name: all courses of the
///   first, then those of the second, and so on.
///
/// Without a collection, "static-validation" is 40 fresh courses of `generator_seed`, so nothing
/// that trains on the named sets has seen them; with one, see `SplitNames`. An empty `collection`
/// path counts as none.
///
/// Throws `Error` that names spec, file and line if there is no such set (the error lists the
/// sets), a file is damaged, the set is empty, one of its courses cannot be driven
/// (`WhyUnsolvable`), or two joined sets have a course of the same name.
CourseSet ResolveCourses(const std::string& spec,
                         const std::optional<std::filesystem::path>& collection,
                         std::uint64_t generator_seed);

/// Whether `ResolveCourses` reads files for `spec`: the set is neither generated nor built in.
bool ReadsFiles(const std::string& spec, const std::optional<std::filesystem::path>& collection);

/// What names of fresh courses of this kind begin with, "generated-box:" for example.
std::string_view FreshCoursePrefix(FreshKind kind);

/// The patterns of fresh courses, for help texts: "generated:SEED:COUNT, generated-box:SEED:COUNT,
/// ...".
std::string FreshCoursePatterns();

/// The names that `ResolveCourses` knows without a path, in the order in which they are shown.
std::vector<std::string> ListCourseSets(const std::optional<std::filesystem::path>& collection);

}  // namespace slalom::sim
