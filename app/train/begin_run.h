#pragma once

#include <string>

#include "app/train/resolved_run.h"
#include "learner/run/run_directory.h"

namespace slalom::train {

/// Prepares the directory of a new run; an earlier run there is moved to `NAME.1`, `NAME.2`, ...
/// first. Throws `base::Error` if it cannot be made or written, or if another process trains there.
run::RunLock BeginRun(const run::RunDirectory& directory, const RunConfig& config);

/// Throws `base::Error` that names `source` and the key if a run with the config `earlier`, as
/// TOML, cannot continue with `config`. Only limits, logging, evaluation and addresses may differ.
void RequireResumable(const std::string& earlier, const std::string& source,
                      const RunConfig& config);

/// Checks that the run there can continue with `config`, whose limits, logging and evaluation may
/// differ, and writes the new config. Throws `base::Error` if there is no run, another key differs,
/// or another process trains there.
run::RunLock ResumeRun(const run::RunDirectory& directory, const RunConfig& config);

/// Begins or resumes a run that drives its own episodes: as the two functions do, and keeps copies
/// of what its config names in its directory (`ReadInputs`, with its errors).
run::RunLock BeginTraining(const run::RunDirectory& directory, const ResolvedRun& config,
                           bool resume);

}  // namespace slalom::train
