#include "app/train/inputs.h"

#include <system_error>

#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "learner/run/run_directory.h"
#include "policy/policy_spec.h"
#include "sim/courses/course_file.h"
#include "sim/courses/course_sets.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

void WarnOfChange(const std::string& named, const fs::path& copy) {
  spdlog::warn("{} is no longer as it was when the run began; the run goes on with {}", named,
               copy.string());
}

/// The set as the text of a file.
std::string TextOf(sim::CourseSet set) {
  if (!sim::IsCourseName(set.name)) set.name.clear();  // Sets that are joined have no such name.
  return sim::PrintCourseSet(set);
}

void AddCourses(const CoursesConfig& courses, const std::string& spec, Inputs& copies) {
  if (!sim::ReadsFiles(spec, courses.collection)) return;
  const fs::path copy = courses.CopyOf(spec);
  const std::string text = TextOf(courses.Resolve(spec));
  copies[copy.filename()] = text;
  if (courses.inputs.empty() || !base::Exists(copy)) return;
  CoursesConfig original = courses;
  original.inputs.clear();
  try {
    if (TextOf(original.Resolve(spec)) != text) WarnOfChange(spec, copy);
  } catch (const base::Error&) {  // It is no longer there, or the run is elsewhere.
  }
}

std::string NameOfCopy(const std::string& policy) {
  return CopyName(policy, policy, ".safetensors");
}

}  // namespace

std::vector<std::string> PolicyFilesOf(const ResolvedRun& run) {
  std::vector<std::string> files;
  for (const Teacher& teacher : run.teachers) {
    if (!teacher.file.empty()) files.push_back(teacher.file);
  }
  const auto add_first = [&files](const RunConfig& config) {
    if (!config.method.learner.from.empty()) files.push_back(config.method.learner.from);
  };
  add_first(run);
  for (const Stage& stage : run.stages) add_first(stage.config);
  return files;
}

fs::path FindPolicy(const fs::path& inputs, const std::string& named) {
  if (inputs.empty()) return named;
  const fs::path copy = inputs / NameOfCopy(named);
  return base::Exists(copy) ? copy : fs::path(named);
}

std::optional<policy::PolicySnapshot> LoadFirstPolicy(const RunConfig& config) {
  const std::string& named = config.method.learner.from;
  if (named.empty()) return std::nullopt;
  const fs::path file = FindPolicy(config.courses.inputs, named);
  policy::PolicySnapshot first = policy::WithoutPlanning(policy::LoadPolicy(file).snapshot);
  policy::PolicySpec spec = MakePolicySpec(config);
  spec.planning = {};
  // These are no part of the actor's weights.
  spec.network.layer_norm = first.spec.network.layer_norm;
  spec.network.dropout = first.spec.network.dropout;
  spec.network.dropout_everywhere = first.spec.network.dropout_everywhere;
  policy::RequireSameSpec("learner.from: " + file.string(), first.spec, spec);
  return first;
}

Inputs ReadPolicies(const ResolvedRun& run) {
  Inputs copies;
  for (const std::string& named : PolicyFilesOf(run)) {
    const fs::path file = FindPolicy(run.courses.inputs, named);
    std::string& bytes = copies[NameOfCopy(named)];
    bytes = base::ReadFile(file);
    std::error_code missing;
    if (file != named && fs::is_regular_file(named, missing) && base::ReadFile(named) != bytes) {
      WarnOfChange(named, file);
    }
  }
  return copies;
}

Inputs ReadInputs(const ResolvedRun& run) {
  Inputs copies = ReadPolicies(run);
  const CoursesConfig& courses = run.courses;
  if (courses.has_named()) AddCourses(courses, courses.train, copies);
  if (courses.test.empty()) return copies;
  try {
    AddCourses(courses, courses.test, copies);
  } catch (const base::Error&) {  // A run that is not scored does without them.
  }
  return copies;
}

void WriteInputs(const Inputs& copies, const fs::path& inputs) {
  if (!copies.empty()) base::MakeDirectories(inputs);
  for (const auto& [name, bytes] : copies) {
    const fs::path file = inputs / name;
    if (base::Exists(file) && base::ReadFile(file) == bytes) continue;
    base::WriteFileAtomically(file, bytes);
  }
}

fs::path InputsOf(const fs::path& policy) {
  std::error_code ec;
  fs::path directory = fs::absolute(policy, ec).parent_path();
  for (int levels = 0; levels < 3; ++levels, directory = directory.parent_path()) {
    const run::RunDirectory run{directory};
    if (fs::exists(run.config(), ec)) return run.inputs();
  }
  return {};
}

}  // namespace slalom::train
