#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "sim/courses/course.h"

/// Slalom's own text format for courses and course sets; docs/courses.md gives it byte by byte.
///
/// A file is a set: it holds its courses, or it names other files that hold one course each.
/// Numbers are written so that reading gives back the same doubles. The last line is a checksum of
/// everything before it. Version 2 has moving obstacles; a set without any is written as version 1.

namespace slalom::sim {

/// File name extensions that this project writes: one course, a set of courses.
inline constexpr std::string_view kCourseExtension = ".course";
inline constexpr std::string_view kCourseSetExtension = ".courses";

/// Prints the set as text that holds every course. `remark` is one line for its readers, a comment.
std::string PrintCourseSet(const CourseSet& set, std::string_view remark = "");

/// Whether a file may have a fixed obstacle no part of which is inside the bounds of its course.
enum class OutsideBounds { kAllow, kRefuse };

/// Parses the set in `text`. Errors call it `source`. Files that it names are relative to
/// `directory`.
///
/// Throws `Error` that names source and line if the text is not a whole, unchanged course file:
/// another format or version, an unknown, misplaced or malformed line, a size that is not above 0,
/// fewer than two key frames or a first one not at time 0, a missing part, an invalid or repeated
/// name, a wrong or missing checksum, an obstacle outside the bounds if `outside` refuses it.
CourseSet ParseCourseSet(std::string_view text, std::string_view source,
                         const std::filesystem::path& directory,
                         OutsideBounds outside = OutsideBounds::kAllow);

/// Reads the file `path`. Throws `Error` as `ParseCourseSet` does, or if the file cannot be read.
CourseSet ReadCourseSet(const std::filesystem::path& path,
                        OutsideBounds outside = OutsideBounds::kAllow);

/// Writes `set` as `PrintCourseSet` prints it to the file `path` atomically. Throws `Error` if that
/// fails.
void WriteCourseSet(const std::filesystem::path& path, const CourseSet& set,
                    std::string_view remark = "");

/// Whether `name` may name a course: 1 to 100 letters, digits, '-', '_', '.'; first not '.'.
bool IsCourseName(std::string_view name);

}  // namespace slalom::sim
