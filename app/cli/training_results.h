#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "app/train/run_config.h"
#include "base/parallel.h"
#include "learner/run/run_directory.h"

namespace slalom::cli {

/// The options of a command that is to read the test courses wherever it is called, from the copies
/// of the run if it has any.
std::vector<std::string> TestCoursesOptions(const train::CoursesConfig& courses);

/// Writes training.html, the page that `slalom watch` shows, as the run is now. If a file cannot be
/// read or written, warns and leaves it out.
void WriteTrainingPage(const run::RunDirectory& directory);

/// Scores the run's policy, and its snapshots' policies (curve.csv), on its test courses; prints
/// the table before it writes anything, then the places of all files and the next commands.
/// `train_longer`: the command that continues the run; empty if none can. Returns false if it was
/// stopped before the end. Throws `base::Error` if a file cannot be read or written.
[[nodiscard]] bool ScoreTraining(const run::RunDirectory& directory, const train::RunConfig& config,
                                 const std::string& train_longer, base::ParallelFor& parallel,
                                 std::stop_token stop);

}  // namespace slalom::cli
