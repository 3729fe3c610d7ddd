#include "app/train/stages.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "app/train/inputs.h"
#include "base/config.h"
#include "base/error.h"
#include "base/name.h"
#include "learner/run/run_directory.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

struct Text {
  std::string text;
  template <class Visitor>
  void Visit(Visitor& v) {
    v("teacher", text, "");
  }
};

/// The config of a stage without its own keys.
RunConfig Plain(const RunConfig& config, const std::string& name) {
  RunConfig stage = config;
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

}  // namespace

std::vector<Stage> StagesOf(const RunConfig& config) {
  std::vector<Stage> stages;
  for (const base::TomlAssignment& entry : config.distillation.stages) {
    const std::string full = "distillation.stages." + entry.key;
    const std::size_t dot = entry.key.find('.');
    if (dot == std::string::npos) {
      throw base::Error(fmt::format("{}: expected STAGE.KEY = VALUE with a key of a config", full));
    }
    const std::string name = entry.key.substr(0, dot), key = entry.key.substr(dot + 1);
    if (!base::IsName(name)) {
      throw base::Error(
          fmt::format("{}: found the stage '{}', expected letters, digits or '-_:@'", full, name));
    }
    if (stages.empty() || stages.back().name != name) {
      stages.push_back({name, Plain(config, name)});
    }
    if (key.starts_with("distillation.") || key == "run.name" || key == "run.seed") {
      throw base::Error(fmt::format("{}: a stage has no {} of its own", full, key));
    }
    try {
      config::SetField(key, entry.value.text, "", config::ListFields(stages.back().config));
    } catch (const base::Error& error) {
      throw base::Error(fmt::format("{}: {}", full, error.what()));
    }
  }
  for (Stage& stage : stages) {
    if (config.run.max_seconds == 0.0) stage.config.run.max_seconds = 0.0;
    if (!stage.config.courses.has_named()) continue;
    throw base::Error(
        fmt::format("distillation.stages.{}: courses.train is \"{}\" and courses.fresh \"{}\", "
                    "expected \"\" and the kinds that it teaches",
                    stage.name, stage.config.courses.train, stage.config.courses.fresh));
  }
  return stages;
}

fs::path StageDirectory(const fs::path& directory, const std::string& stage) {
  return directory / "stages" / stage;
}

std::vector<fs::path> RunsOf(const RunConfig& config, const fs::path& directory) {
  std::vector<fs::path> runs;
  for (const Stage& stage : StagesOf(config)) runs.push_back(StageDirectory(directory, stage.name));
  runs.push_back(directory);
  return runs;
}

std::int64_t MaxStepsOf(const RunConfig& config) {
  std::int64_t steps = config.run.max_steps;
  for (const Stage& stage : StagesOf(config)) steps += stage.config.run.max_steps;
  return steps;
}

std::string TeacherFile(const base::TomlAssignment& teacher) {
  try {
    return config::FromToml<Text>(fmt::format("teacher = {}", teacher.value.text), "").text;
  } catch (const base::Error&) {
    throw base::Error(fmt::format("distillation.teachers.{}: found {}, expected a policy file",
                                  teacher.key, teacher.value.text));
  }
}

double MaxSecondsOf(const RunConfig& config) {
  double seconds = config.run.max_seconds;
  for (const Stage& stage : StagesOf(config)) seconds += stage.config.run.max_seconds;
  return seconds;
}

std::map<sim::FreshKind, fs::path> TeacherFiles(const RunConfig& config,
                                                const fs::path& directory) {
  const sim::FreshMix mix = config.courses.Mix();
  std::map<sim::FreshKind, fs::path> files;
  const auto add = [&](sim::FreshKind kind, const std::string& key, fs::path file) {
    if (std::ranges::find(mix, kind) == mix.end()) {
      throw base::Error(
          fmt::format("{}: teaches {}, expected a kind of courses.fresh, which is \"{}\"", key,
                      base::EnumName(kind), config.courses.fresh));
    }
    if (!files.emplace(kind, std::move(file)).second) {
      throw base::Error(
          fmt::format("{}: teaches {}, which has another teacher", key, base::EnumName(kind)));
    }
  };
  for (const base::TomlAssignment& teacher : config.distillation.teachers) {
    const std::string key = "distillation.teachers." + teacher.key;
    sim::FreshKind kind{};
    if (!base::ParseEnum(teacher.key, kind)) {
      throw base::Error(fmt::format("{}: expected a kind of courses.fresh, which is \"{}\"", key,
                                    config.courses.fresh));
    }
    add(kind, key, FindPolicy(config.courses.inputs, TeacherFile(teacher)));
  }
  for (const Stage& stage : StagesOf(config)) {
    sim::FreshMix kinds = stage.config.courses.Mix();
    std::ranges::sort(kinds);
    kinds.erase(std::unique(kinds.begin(), kinds.end()), kinds.end());
    for (const sim::FreshKind kind : kinds) {
      add(kind, "distillation.stages." + stage.name,
          run::RunDirectory{StageDirectory(directory, stage.name)}.policy());
    }
  }
  for (const sim::FreshKind kind : mix) {
    if (files.contains(kind)) continue;
    throw base::Error(
        fmt::format("distillation: found no teacher of {}, expected one for each "
                    "kind of courses.fresh, in distillation.teachers or .stages",
                    base::EnumName(kind)));
  }
  return files;
}

}  // namespace slalom::train
