#pragma once

#include "run/run_directory.h"
#include "train/run_config.h"

namespace slalom::train {

/// Prepares the directory of a new run; an earlier run there is moved to `NAME.1`, `NAME.2`, ...
/// first. Throws `base::Error` where it cannot be made or written, or another process
/// trains there.
run::RunLock BeginRun(const run::RunDirectory& directory, const RunConfig& config);

/// Checks that the run there can go on with `config`, whose limits, logging and evaluation may
/// differ, and writes the new config. Throws `base::Error` where there is no run, another key
/// differs, or another process trains there.
run::RunLock ResumeRun(const run::RunDirectory& directory, const RunConfig& config);

}  // namespace slalom::train
