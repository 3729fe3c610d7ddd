#pragma once

#include <string_view>

#include "app/train/run_config.h"

/// What makes a run's config sound, each rule once. `Resolve` (app/train/resolved_run.h) applies
/// them; sections that are other folders' have their rules there (`learner::RequireConsistent`,
/// `sim::CheckRandomization`). Each function throws `base::Error` that names the key.

namespace slalom::train {

/// What a command does with a run, on which some rules depend.
struct RunUse {
  std::string_view drives = {};  ///< Program that drives its robots on courses; empty: it does not.
  bool begins = false;           ///< It begins to learn. A run that goes on may end at once.
  bool serves = false;           ///< It is a process of the distributed service.
};

/// Throws if sections contradict each other, a key is set that nothing reads
/// (`config::RequireRead`), or the command cannot use the run.
void RequireSound(const RunConfig& config, const RunUse& use);

/// Throws if the config is for an environment of the user's own, which `who` does not drive.
void RequireCourses(const RunConfig& config, std::string_view who);

/// Throws if the run's policies are trained under a constraint, which planning would ignore.
void RequireNoConstraint(const RunConfig& config);

/// Throws if a new run certainly learns nothing: it ends by `run.max_steps` before its first
/// update, or its replay cannot hold the samples of one update.
void RequireLearnable(const RunConfig& config);

}  // namespace slalom::train
