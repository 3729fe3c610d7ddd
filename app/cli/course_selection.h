#pragma once

#include <CLI/App.hpp>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sim/courses/course.h"

namespace slalom::cli {

/// The help text of an option that names a course set.
std::string CourseSpecHelp();

/// The part of a command line that chooses courses.
struct CourseSelection {
  std::string spec;
  std::optional<std::string> collection;
  std::uint64_t seed = 1;
  std::vector<std::string> names;  ///< Names of courses in the set; empty: all.

  /// Adds the options --collection and --seed, which write into this object.
  void AddSource(CLI::App& command);

  std::optional<std::filesystem::path> collection_path() const;

  /// Returns the chosen courses, in the order of the set. Throws `base::Error` if there is no such
  /// set or if it lacks a course of one of the names.
  sim::CourseSet Resolve() const;

  /// Returns the courses of `set` that `names` choose. Throws like `Resolve`; the error names
  /// `source`.
  sim::CourseSet Choose(sim::CourseSet set, const std::string& source) const;
};

/// Throws `base::Error` if `--collection` does not name a directory, even if no set from it is
/// used. An empty name stands for the built-in courses and is accepted.
void RequireCollection(const std::string& directory);

/// Prints the `CourseWarnings` of each course to stderr; of more than five, the first five.
void PrintCourseWarnings(const std::vector<std::shared_ptr<const sim::Course>>& courses);

}  // namespace slalom::cli
