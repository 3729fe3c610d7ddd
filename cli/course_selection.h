#pragma once

#include <CLI/App.hpp>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "sim/course.h"

namespace slalom::cli {

/// The help text of an option that names a course set.
inline constexpr char kCourseSpecHelp[] =
    "Set name (see `slalom courses list`), generated:SEED:COUNT, generated-box:SEED:COUNT, "
    "generated-wall:SEED:COUNT, or the path of a course file, a set file or a directory of course "
    "files";

/// What a command works on: the words that choose a course set.
struct CourseSelection {
  std::string spec;
  std::optional<std::string> collection;
  std::uint64_t seed = 1;
  std::vector<std::string> names;  ///< Of courses in the set; empty: all.

  /// Adds --collection and --seed, which write into this.
  void AddSource(CLI::App& command);

  std::optional<std::filesystem::path> collection_path() const;

  /// The chosen courses, in the order of the set. Throws `base::Error` where the set cannot be had
  /// or has no course of one of the names.
  sim::CourseSet Resolve() const;

  /// Those of `set` that `names` choose. Throws `base::Error` naming `source` as `Resolve`.
  sim::CourseSet Choose(sim::CourseSet set, const std::string& source) const;
};

/// Throws `base::Error` where `--collection` names no directory, also if no set of it is asked for.
/// Empty: the built-in courses.
void RequireCollection(const std::string& directory);

}  // namespace slalom::cli
