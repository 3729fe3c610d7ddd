#include "app/train/resolved_run.h"

#include <fmt/format.h>

#include <algorithm>

#include "app/train/inputs.h"
#include "base/config.h"
#include "base/error.h"
#include "base/name.h"
#include "learner/run/run_directory.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

/// The config of a stage without its own keys.
ResolvedRun Plain(const RunConfig& config, const std::string& name) {
  ResolvedRun stage{config, {}, {}};
  stage.distillation = {};
  stage.method.learner.algorithm = learner::LearnerConfig{}.algorithm;
  stage.method.learner.from = "";
  stage.courses.test = "";
  stage.run.name = name;
  stage.run.keep_checkpoints = run::KeepCheckpoints::kNone;
  stage.run.snapshot_steps = {};
  stage.run.snapshot_seconds = {};
  return stage;
}

/// Sets a key of a stage, which the assignment's key names: STAGE.KEY.
void Apply(const base::TomlAssignment& entry, const RunConfig& config, std::vector<Stage>& stages) {
  const std::string full = "distillation.stages." + entry.key;
  const std::size_t dot = entry.key.find('.');
  base::ThrowIf(dot == std::string::npos, "{}: expected STAGE.KEY = VALUE with a key of a config",
                full);
  const std::string name = entry.key.substr(0, dot), key = entry.key.substr(dot + 1);
  base::ThrowIf(!base::IsName(name), "{}: found the stage '{}', expected letters, digits or '-_:@'",
                full, name);
  if (stages.empty() || stages.back().name != name) stages.push_back({name, Plain(config, name)});
  base::ThrowIf(key.starts_with("distillation.") || key == "run.name" || key == "run.seed",
                "{}: a stage has no {} of its own", full, key);
  try {
    config::SetField(key, entry.value.text, "", config::ListFields(stages.back().config));
  } catch (const base::Error& error) {
    throw base::Error("{}: {}", full, error.what());
  }
}

std::vector<Stage> ReadStages(const RunConfig& config) {
  std::vector<Stage> stages;
  for (const base::TomlAssignment& entry : config.distillation.stages) Apply(entry, config, stages);
  for (Stage& stage : stages) {
    if (config.run.max_seconds == 0.0) stage.config.run.max_seconds = 0.0;
    if (!stage.config.courses.has_named()) continue;
    throw base::Error(
        "distillation.stages.{}: courses.train is \"{}\" and courses.fresh \"{}\", expected \"\" "
        "and the kinds that it teaches",
        stage.name, stage.config.courses.train, stage.config.courses.fresh);
  }
  return stages;
}

struct Text {
  std::string text;
  template <class Visitor>
  void Visit(Visitor& v) {
    v("teacher", text, "");
  }
};

Teacher ReadTeacher(const base::TomlAssignment& entry, const RunConfig& config) {
  Teacher teacher;
  base::ThrowIf(!base::ParseEnum(entry.key, teacher.kind),
                "distillation.teachers.{}: expected a kind of courses.fresh, which is \"{}\"",
                entry.key, config.courses.fresh);
  try {
    teacher.file = config::FromToml<Text>(fmt::format("teacher = {}", entry.value.text), "").text;
  } catch (const base::Error&) {
    throw base::Error("distillation.teachers.{}: found {}, expected a policy file", entry.key,
                      entry.value.text);
  }
  return teacher;
}

std::vector<Teacher> ReadTeachers(const ResolvedRun& run) {
  std::vector<Teacher> teachers;
  for (const base::TomlAssignment& entry : run.distillation.teachers) {
    teachers.push_back(ReadTeacher(entry, run));
  }
  for (const Stage& stage : run.stages) {
    sim::FreshMix kinds = stage.config.courses.Mix();
    std::ranges::sort(kinds);
    kinds.erase(std::unique(kinds.begin(), kinds.end()), kinds.end());
    for (const sim::FreshKind kind : kinds) teachers.push_back({kind, "", stage.name});
  }
  return teachers;
}

/// Throws unless each kind of courses has one teacher, and each teacher such a kind.
void RequireTeachers(const ResolvedRun& run) {
  const sim::FreshMix mix = run.courses.Mix();
  for (auto teacher = run.teachers.begin(); teacher != run.teachers.end(); ++teacher) {
    const std::string_view kind = base::EnumName(teacher->kind);
    const std::string key = teacher->stage.empty() ? fmt::format("distillation.teachers.{}", kind)
                                                   : "distillation.stages." + teacher->stage;
    base::ThrowIf(std::ranges::find(mix, teacher->kind) == mix.end(),
                  "{}: teaches {}, expected a kind of courses.fresh, which is \"{}\"", key, kind,
                  run.courses.fresh);
    const auto first = std::ranges::find(run.teachers, teacher->kind, &Teacher::kind);
    base::ThrowIf(first != teacher, "{}: teaches {}, which has another teacher", key, kind);
  }
  for (const sim::FreshKind kind : mix) {
    const auto teacher = std::ranges::find(run.teachers, kind, &Teacher::kind);
    if (teacher != run.teachers.end()) continue;
    throw base::Error(
        "distillation: found no teacher of {}, expected one for each kind of courses.fresh, in "
        "distillation.teachers or .stages",
        base::EnumName(kind));
  }
}

}  // namespace

void ResolvedRun::ReadCopies(const fs::path& inputs) {
  courses.inputs = inputs;
  for (Stage& stage : stages) stage.config.courses.inputs = inputs;
}

ResolvedRun ResolveRecorded(const RunConfig& config) {
  ResolvedRun run{config, ReadStages(config), {}};
  run.teachers = ReadTeachers(run);
  return run;
}

ResolvedRun Resolve(const RunConfig& config, const RunUse& use) {
  RequireSound(config, use);
  ResolvedRun run = ResolveRecorded(config);
  if (learner::TraitsOf(config.method.learner).is_taught) RequireTeachers(run);
  for (const Stage& stage : run.stages) {
    try {
      RequireSound(stage.config, use);
    } catch (const base::Error& error) {
      throw base::Error("distillation.stages.{}: {}", stage.name, error.what());
    }
  }
  return run;
}

fs::path StageDirectory(const fs::path& directory, const std::string& stage) {
  return directory / "stages" / stage;
}

std::vector<fs::path> RunsOf(const ResolvedRun& run, const fs::path& directory) {
  std::vector<fs::path> runs;
  for (const Stage& stage : run.stages) runs.push_back(StageDirectory(directory, stage.name));
  runs.push_back(directory);
  return runs;
}

std::int64_t MaxStepsOf(const ResolvedRun& run) {
  std::int64_t steps = run.run.max_steps;
  for (const Stage& stage : run.stages) steps += stage.config.run.max_steps;
  return steps;
}

double MaxSecondsOf(const ResolvedRun& run) {
  double seconds = run.run.max_seconds;
  for (const Stage& stage : run.stages) seconds += stage.config.run.max_seconds;
  return seconds;
}

std::map<sim::FreshKind, fs::path> TeacherFiles(const ResolvedRun& run, const fs::path& directory) {
  std::map<sim::FreshKind, fs::path> files;
  for (const Teacher& teacher : run.teachers) {
    files[teacher.kind] =
        teacher.stage.empty()
            ? FindPolicy(run.courses.inputs, teacher.file)
            : run::RunDirectory{StageDirectory(directory, teacher.stage)}.policy();
  }
  return files;
}

}  // namespace slalom::train
