#include "sim/courses/course_sets.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <initializer_list>
#include <memory>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/error.h"
#include "base/name.h"
#include "base/random.h"
#include "base/split.h"
#include "sim/courses/course_check.h"
#include "sim/courses/course_file.h"
#include "sim/courses/course_generator.h"
#include "sim/courses/course_splits.h"
#include "sim/courses/dynamic_generator.h"
#include "sim/courses/real_world_courses.h"
#include "sim/courses/reference_path.h"

namespace slalom::sim {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kRealWorldPrefix = "real-world-";
constexpr std::string_view kValidation = "static-validation";
constexpr int kMaxGenerated = 100000;
constexpr char kJoin = '+';

void CheckSolvable(const CourseSet& set, const fs::path& source) {
  base::ThrowIf(set.courses.empty(), "{}: the course set is empty", source.string());
  for (const auto& course : set.courses) {
    if (const auto reason = WhyUnsolvable(*course)) {
      throw base::Error("{}: course {} cannot be driven: {}", source.string(), course->name,
                        *reason);
    }
  }
}

/// Files of `directory` with one of these extensions, by name.
std::vector<fs::path> ListFiles(const fs::path& directory,
                                std::initializer_list<std::string_view> extensions) {
  std::vector<fs::path> files;
  std::error_code error;
  fs::directory_iterator entries(directory, error);
  if (error) throw base::Error("{}: cannot be listed: {}", directory.string(), error.message());
  for (const fs::directory_entry& entry : entries) {
    const std::string extension = entry.path().extension().string();
    if (std::ranges::find(extensions, extension) != extensions.end()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// Reads a file of one's own: it is checked, and courses without a reference path get one.
CourseSet ReadOwnFile(const fs::path& file) {
  CourseSet set = ReadCourseSet(file, OutsideBounds::kRefuse);
  CheckSolvable(set, file);
  for (auto& course : set.courses) {
    if (!course->reference_path_W.empty()) continue;
    std::vector<base::Vec2> path_W = FindReferencePath(*course);
    if (path_W.empty()) continue;
    auto with_path = std::make_shared<Course>(*course);
    with_path->reference_path_W = std::move(path_W);
    course = std::move(with_path);
  }
  return set;
}

CourseSet ReadDirectory(const fs::path& directory) {
  CourseSet set{fs::absolute(directory).lexically_normal().filename().string(), {}};
  const std::vector<fs::path> files = ListFiles(directory, {kCourseExtension, kCourseSetExtension});
  base::ThrowIf(files.empty(),
                "{}: the directory holds no *{} or *{} file, so the course set is empty",
                directory.string(), kCourseExtension, kCourseSetExtension);
  for (const fs::path& file : files) {
    const CourseSet part = ReadOwnFile(file);
    for (const auto& course : part.courses) {
      const bool is_known = std::any_of(set.courses.begin(), set.courses.end(),
                                        [&](const auto& c) { return c->name == course->name; });
      if (is_known) {
        throw base::Error(
            "{}: another file of the directory holds a course {} already; to choose one of its "
            "sets, give the set's file, or its name with the directory as the collection",
            file.string(), course->name);
      }
      set.courses.push_back(course);
    }
  }
  return set;
}

CourseSet ResolveGenerated(const std::string& spec, const FreshSource& source) {
  const std::string_view rest = std::string_view(spec).substr(source.prefix.size());
  const std::size_t colon = rest.find(':');
  const auto seed = base::ParseNumber<std::uint64_t>(rest.substr(0, colon));
  const auto count = base::ParseNumber<int>(colon < rest.size() ? rest.substr(colon + 1) : "");
  base::ThrowIf(!seed || !count || *count < 1 || *count > kMaxGenerated,
                "\"{}\": expected {}SEED:COUNT with a seed of 0 or above and a count from 1 to {}",
                spec, source.prefix, kMaxGenerated);
  CourseSet set = source.set(*seed, *count);
  set.name = spec;
  return set;
}

/// The number of "real-world-NUMBER", if there is such a course.
std::optional<int> RealWorldNumber(std::string_view name) {
  if (!name.starts_with(kRealWorldPrefix)) return std::nullopt;
  const auto number = base::ParseNumber<int>(name.substr(kRealWorldPrefix.size()));
  return number >= 1 && number <= kNumRealWorldCourses ? number : std::nullopt;
}

CourseSet BuiltInSet(const std::string& name, const CourseSplit& split, std::uint64_t seed) {
  CourseSet set{name, {}};
  if (name == kValidation) {
    set.courses =
        GenerateFreshCourses(base::DeriveSeed(seed, "static-validation"), kNumValidationCourses)
            .courses;
    return set;
  }
  const auto generate = split.kind == CourseKind::kStatic       ? GenerateStaticCourses
                        : split.kind == CourseKind::kDynamicBox ? GenerateBoxCourses
                                                                : GenerateWallCourses;
  for (const int index : split.indices) {
    set.courses.push_back(generate(seed, index, 1).courses.front());
  }
  return set;
}

CourseSet ResolveOne(const std::string& spec, const std::optional<fs::path>& collection,
                     std::uint64_t generator_seed) {
  for (const FreshSource& source : FreshSources()) {
    if (spec.starts_with(source.prefix)) return ResolveGenerated(spec, source);
  }
  if (const auto number = RealWorldNumber(spec)) {
    return {spec, {std::make_shared<const Course>(RealWorldCourse(*number))}};
  }
  if (collection && !collection->empty()) {
    const fs::path file = *collection / (spec + std::string(kCourseSetExtension));
    if (IsCourseName(spec) && fs::exists(file)) {
      CourseSet set = ReadCourseSet(file);
      CheckSolvable(set, file);
      return set;
    }
  } else if (const auto split = FindSplit(spec)) {
    return BuiltInSet(spec, *split, generator_seed);
  }
  const fs::path path(spec);
  std::error_code error;
  if (fs::is_directory(path, error)) return ReadDirectory(path);
  if (!spec.empty() && fs::exists(path, error)) return ReadOwnFile(path);
  if (collection && !collection->empty() && !fs::is_directory(*collection, error)) {
    throw base::Error(
        "{}: is no directory, expected a collection that `slalom courses import` wrote",
        collection->string());
  }
  const std::vector<std::string> names = ListCourseSets(collection);
  const std::string suggestion = base::Suggestion(spec, names);
  throw base::Error(
      "\"{}\" is neither a course set nor a file{}{}{}here are: {}, {}, or the path of a course "
      "file, a course-set file or a directory of course files",
      spec,
      collection && !collection->empty() ? fmt::format(" (in collection {})", collection->string())
                                         : "",
      suggestion, suggestion.empty() ? "; t" : " T", fmt::join(names, ", "), FreshCoursePatterns());
}

/// Whether `spec` joins several sets.
bool IsJoined(const std::string& spec) {
  std::error_code error;
  return spec.find(kJoin) != std::string::npos && !fs::exists(spec, error);
}

/// Joins the sets of the parts of `spec`.
CourseSet ResolveSeveral(const std::string& spec, const std::optional<fs::path>& collection,
                         std::uint64_t generator_seed) {
  CourseSet all{spec, {}};
  std::set<std::string_view> names;
  for (const std::string_view one : base::Split(spec, kJoin)) {
    const CourseSet part = ResolveOne(std::string(one), collection, generator_seed);
    for (const auto& course : part.courses) {
      if (!names.insert(course->name).second) {
        throw base::Error(
            "\"{}\": two of these sets hold a course {}, expected sets whose courses have "
            "different names",
            spec, course->name);
      }
      all.courses.push_back(course);
    }
  }
  return all;
}

}  // namespace

CourseSet ResolveCourses(const std::string& spec, const std::optional<fs::path>& collection,
                         std::uint64_t generator_seed) {
  return (IsJoined(spec) ? ResolveSeveral : ResolveOne)(spec, collection, generator_seed);
}

bool ReadsFiles(const std::string& spec, const std::optional<fs::path>& collection) {
  const bool is_built_in = !collection || collection->empty();
  const std::vector<std::string_view> parts =
      IsJoined(spec) ? base::Split(spec, kJoin) : std::vector<std::string_view>{spec};
  return std::ranges::any_of(parts, [is_built_in](std::string_view one) {
    const bool is_generated = std::ranges::any_of(FreshSources(), [one](const FreshSource& source) {
      return one.starts_with(source.prefix);
    });
    return !is_generated && !RealWorldNumber(one) && !(is_built_in && FindSplit(one));
  });
}

std::string_view FreshCoursePrefix(FreshKind kind) {
  return FreshSources()[static_cast<std::size_t>(kind)].prefix;
}

std::string FreshCoursePatterns() {
  std::string patterns;
  for (const FreshSource& source : FreshSources()) {
    patterns += fmt::format("{}{}SEED:COUNT", patterns.empty() ? "" : ", ", source.prefix);
  }
  return patterns;
}

std::vector<std::string> ListCourseSets(const std::optional<fs::path>& collection) {
  std::vector<std::string> names;
  for (const std::string_view name : SplitNames()) names.emplace_back(name);
  if (collection && !collection->empty()) {
    std::vector<std::string> others;
    for (const fs::path& file : ListFiles(*collection, {kCourseSetExtension})) {
      others.push_back(file.stem().string());
    }
    // The paper's sets first, in their own order, as far as the collection has them.
    std::erase_if(names, [&](const std::string& name) { return std::erase(others, name) == 0; });
    names.insert(names.end(), others.begin(), others.end());
  }
  for (int number = 1; number <= kNumRealWorldCourses; ++number) {
    names.push_back(fmt::format("{}{}", kRealWorldPrefix, number));
  }
  return names;
}

}  // namespace slalom::sim
