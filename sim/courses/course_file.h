#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "sim/courses/course.h"

/// Slalom's own text format for courses and course sets; docs/courses.md gives it byte by byte.
///
/// A file is a set: its courses stand in it, or it names other files that hold one course each.
/// Numbers are written so that reading gives back the same doubles. The last line is a checksum of
/// all before it. Version 2 has moving obstacles; a set without any is written as version 1, so the
/// bytes of a static set never change.

namespace slalom::sim {

/// File name extensions that this project writes: one course, a set of courses.
inline constexpr std::string_view kCourseExtension = ".course";
inline constexpr std::string_view kCourseSetExtension = ".courses";

/// The set as text, every course in it.
std::string PrintCourseSet(const CourseSet& set);

/// The set that `text` holds. `source` names it in errors; files that it names are sought in
/// `directory`.
///
/// Throws `Error` that names source and line where the text is not a whole, unchanged course file:
/// another format or version, an unknown or misplaced or malformed line, a size that is not above
/// 0, key frames that are not two or more from time 0 on, a missing part, a name that is not one or
/// stands twice, a wrong or missing checksum.
CourseSet ParseCourseSet(std::string_view text, std::string_view source,
                         const std::filesystem::path& directory);

/// Reads the file `path`. Throws `Error` as `ParseCourseSet` does, or where it cannot be read.
CourseSet ReadCourseSet(const std::filesystem::path& path);

/// Writes `set`, every course in it, to the file `path` atomically. Throws `Error` where that
/// fails.
void WriteCourseSet(const std::filesystem::path& path, const CourseSet& set);

/// Whether `name` may name a course: 1 to 100 letters, digits, '-', '_', '.'; first not '.'.
bool IsCourseName(std::string_view name);

}  // namespace slalom::sim
