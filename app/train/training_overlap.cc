#include "app/train/training_overlap.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "app/train/inputs.h"
#include "base/error.h"
#include "base/log.h"
#include "policy/policy.h"
#include "sim/courses/course_overlap.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

/// The courses that a policy was trained on.
struct TrainingCourses {
  sim::CourseSet set;
  std::vector<std::string> names;  ///< Of the sets, for people.
  bool is_complete = true;         ///< Whether all could be read.
};

/// Adds the courses of a training, and of those before it: of its teachers, and of the policy that
/// it started from. Those that can no longer be read, for example because a file was moved, are
/// left out with a warning.
void AddTrainingCourses(const RunConfig& config, TrainingCourses& courses,
                        std::set<fs::path>& seen) {
  const auto unless_missing = [&courses](const auto& add) {
    try {
      add();
    } catch (const base::Error& error) {
      spdlog::warn("cannot tell whether the policy was trained on these courses: {}", error.what());
      courses.is_complete = false;
    }
  };
  unless_missing([&] {
    const sim::CourseSet set = config.courses.ResolveTrain();
    courses.set.courses.insert(courses.set.courses.end(), set.courses.begin(), set.courses.end());
    courses.names.push_back(config.courses.DescribeTrain());
  });
  for (const std::string& named : PolicyFilesOf(ResolveRecorded(config))) {
    const fs::path file = FindPolicy(config.courses.inputs, named);
    if (!seen.insert(file).second) continue;
    unless_missing([&] {
      auto earlier = TrainedConfig(policy::LoadPolicy(file).metadata, file.string());
      base::ThrowIf(!earlier, "{}: carries no config", file.string());
      earlier->courses.inputs = InputsOf(file);
      AddTrainingCourses(*earlier, courses, seen);
    });
  }
}

}  // namespace

std::optional<eval::TrainingOverlap> FindTrainingOverlap(const sim::CourseSet& scored,
                                                         const RunConfig& trained) {
  TrainingCourses courses;
  std::set<fs::path> seen;
  AddTrainingCourses(trained, courses, seen);
  const int count = sim::CountSharedCourses(scored, courses.set);
  if (count == 0 && !courses.is_complete) return std::nullopt;
  return eval::TrainingOverlap{count, static_cast<int>(scored.courses.size()),
                               fmt::format("{}", fmt::join(courses.names, ", "))};
}

}  // namespace slalom::train
