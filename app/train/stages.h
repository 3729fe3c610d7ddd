#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "app/train/run_config.h"
#include "sim/courses/course_stream.h"

namespace slalom::train {

/// A training that comes before a distillation and makes one of its teachers.
struct Stage {
  std::string name;
  RunConfig config;
};

/// The stages of a run (`DistillationConfig::stages`), in the order of their names. Throws
/// `base::Error` that names the key if one is unknown or its value does not fit, or a stage has
/// named courses or stages of its own.
std::vector<Stage> StagesOf(const RunConfig& config);

/// The directory of a stage of the run in `directory`.
std::filesystem::path StageDirectory(const std::filesystem::path& directory,
                                     const std::string& stage);

/// The directories of the stages of the run in `directory`, and that directory itself, in the order
/// in which they are trained. Throws as `StagesOf`.
std::vector<std::filesystem::path> RunsOf(const RunConfig& config,
                                          const std::filesystem::path& directory);

/// The most environment steps of a run and its stages together. Throws as `StagesOf`.
std::int64_t MaxStepsOf(const RunConfig& config);

/// The most training time of a run and its stages together, [s]. 0 if the run has no limit. Throws
/// as `StagesOf`.
double MaxSecondsOf(const RunConfig& config);

/// The policy file that an entry of `DistillationConfig::teachers` names. Throws `base::Error` that
/// names the key if it is no text.
std::string TeacherFile(const base::TomlAssignment& teacher);

/// The policy file that teaches each kind of `courses.fresh` of the run in `directory`. Throws
/// `base::Error` that names the key as `StagesOf`, and if a kind has no teacher or two, or a
/// teacher has no kind.
std::map<sim::FreshKind, std::filesystem::path> TeacherFiles(
    const RunConfig& config, const std::filesystem::path& directory);

}  // namespace slalom::train
