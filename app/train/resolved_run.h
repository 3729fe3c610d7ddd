#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "app/train/run_config.h"
#include "app/train/run_rules.h"
#include "sim/courses/course_stream.h"

namespace slalom::train {

struct Stage;

/// A policy that teaches a kind of `courses.fresh`.
struct Teacher {
  sim::FreshKind kind{};
  std::string file;   ///< As `distillation.teachers` names it; empty if a stage makes it.
  std::string stage;  ///< Name of that stage.
};

/// A run's config with what its texts name as values: `Resolve` makes it at a command's entry, and
/// what is behind takes it and checks nothing.
struct ResolvedRun : RunConfig {
  std::vector<Stage> stages;      ///< In the order of their names.
  std::vector<Teacher> teachers;  ///< One for each kind of `courses.fresh`, those from files first.

  /// Lets the run and its stages read copies in `inputs` (`CollectionConfig::inputs`).
  void ReadCopies(const std::filesystem::path& inputs);
};

/// A training that comes before a distillation and makes one of its teachers.
struct Stage {
  std::string name;
  ResolvedRun config;
};

/// Returns a config that is sound for a command that does `use`. Throws `base::Error` that names
/// the key if a rule is broken (`RequireSound`), also by a stage; if a key of a stage is unknown,
/// its value does not fit or it may not have it; and if a kind of courses has no teacher or two, or
/// a teacher has no kind.
ResolvedRun Resolve(const RunConfig& config, const RunUse& use = {});

/// Likewise, for the config of a run or a policy, whose rules its own command applied.
ResolvedRun ResolveRecorded(const RunConfig& config);

/// The directory of a stage of the run in `directory`.
std::filesystem::path StageDirectory(const std::filesystem::path& directory,
                                     const std::string& stage);

/// The directories of the stages of the run in `directory`, and that directory itself, in the order
/// in which they are trained.
std::vector<std::filesystem::path> RunsOf(const ResolvedRun& run,
                                          const std::filesystem::path& directory);

/// The most environment steps of a run and its stages together.
std::int64_t MaxStepsOf(const ResolvedRun& run);

/// The most training time of a run and its stages together, [s]. 0 if the run has no limit.
double MaxSecondsOf(const ResolvedRun& run);

/// The policy file that teaches each kind of `courses.fresh` of the run in `directory`.
std::map<sim::FreshKind, std::filesystem::path> TeacherFiles(
    const ResolvedRun& run, const std::filesystem::path& directory);

}  // namespace slalom::train
