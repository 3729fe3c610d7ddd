#include "app/cli/course_selection.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>

#include "base/error.h"
#include "base/name.h"
#include "sim/courses/course_check.h"
#include "sim/courses/course_sets.h"

namespace slalom::cli {

std::string CourseSpecHelp() {
  return fmt::format(
      "Set name (see `slalom courses list`), {}, or the path of a course file, a set file or a "
      "directory of course files",
      sim::FreshCoursePatterns());
}

void CourseSelection::AddSource(CLI::App& command) {
  command.add_option("--collection", collection,
                     "Directory that `slalom courses import` wrote [the built-in courses]");
  command.add_option("--seed", seed, "Seed of the built-in courses")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{9'000'000'000'000'000}))
      ->capture_default_str();
}

std::optional<std::filesystem::path> CourseSelection::collection_path() const {
  if (collection) RequireCollection(*collection);
  return collection ? std::optional<std::filesystem::path>(*collection) : std::nullopt;
}

sim::CourseSet CourseSelection::Resolve() const {
  return Choose(sim::ResolveCourses(spec, collection_path(), seed), spec);
}

sim::CourseSet CourseSelection::Choose(sim::CourseSet set, const std::string& source) const {
  if (names.empty()) return set;
  for (const std::string& name : names) {
    const bool is_there = std::any_of(set.courses.begin(), set.courses.end(),
                                      [&](const auto& c) { return c->name == name; });
    if (!is_there) {
      std::vector<std::string> there;
      for (const auto& course : set.courses) there.push_back(course->name);
      throw base::Error("{}: holds no course named {}{}; it has {} courses, the first is {}",
                        source, name, base::Suggestion(name, there), there.size(), there.front());
    }
  }
  std::erase_if(set.courses, [&](const auto& course) {
    return std::find(names.begin(), names.end(), course->name) == names.end();
  });
  return set;
}

void RequireCollection(const std::string& directory) {
  std::error_code error;
  if (directory.empty() || std::filesystem::is_directory(directory, error)) return;
  throw base::Error(
      "--collection {}: is not a directory, expected one that `slalom courses import` wrote",
      directory);
}

void PrintCourseWarnings(const std::vector<std::shared_ptr<const sim::Course>>& courses) {
  constexpr int kMaxShown = 5;
  int num_shown = 0;
  int num_hidden = 0;
  for (const auto& course : courses) {
    for (const std::string& warning : sim::CourseWarnings(*course)) {
      if (num_shown++ < kMaxShown) {
        fmt::print(stderr, "warning: {}: {}\n", course->name, warning);
      } else {
        ++num_hidden;
      }
    }
  }
  if (num_hidden > 0) fmt::print(stderr, "warning: and {} more of this kind\n", num_hidden);
}

}  // namespace slalom::cli
