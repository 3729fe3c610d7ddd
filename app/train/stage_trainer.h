#pragma once

#include <stop_token>
#include <string>

#include "app/train/run_config.h"
#include "app/train/trainer.h"
#include "learner/run/run_directory.h"

namespace slalom::train {

/// Trains the stages of the run in `directory` that are not finished, and goes on with one that was
/// interrupted. `commit`: as for `Trainer`. Returns kFinished, or how the first stage that did not
/// finish ended: kStopped or kUnsaved. Throws `base::Error` that names the stage if it diverged or
/// learned nothing, and as `Trainer` does.
TrainingEnd TrainStages(const RunConfig& config, const run::RunDirectory& directory,
                        const std::string& commit, const std::stop_token& stop);

}  // namespace slalom::train
