#include "cli/course_selection.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "base/error.h"
#include "sim/course_sets.h"

namespace slalom::cli {

void CourseSelection::AddSource(CLI::App& command) {
  command.add_option(
      "--collection", collection,
      "Directory written by `slalom courses import`; without it, the built-in courses");
  command.add_option("--seed", seed, "Seed of the built-in courses")->capture_default_str();
}

std::optional<std::filesystem::path> CourseSelection::collection_path() const {
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
      throw base::Error(fmt::format("{}: holds no course {}; it has {} courses, the first is {}",
                                    source, name, set.courses.size(), set.courses.front()->name));
    }
  }
  std::erase_if(set.courses, [&](const auto& course) {
    return std::find(names.begin(), names.end(), course->name) == names.end();
  });
  return set;
}

}  // namespace slalom::cli
