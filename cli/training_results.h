#pragma once

#include <stop_token>

#include "base/parallel.h"
#include "run/run_directory.h"
#include "train/run_config.h"

namespace slalom::cli {

/// Draws metrics.csv, and curve.csv where there is one, as training.svg. Throws `base::Error` where
/// a file cannot be read or written.
void DrawTraining(const run::RunDirectory& directory);

/// Scores the run's policy, and those of its snapshots (curve.csv), on its test courses; prints the
/// table, where everything lies and what to do next. False: stopped first. Throws `base::Error` as
/// its parts do.
[[nodiscard]] bool ScoreTraining(const run::RunDirectory& directory, const train::RunConfig& config,
                                 base::ParallelFor& parallel, std::stop_token stop);

}  // namespace slalom::cli
