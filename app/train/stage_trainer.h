#pragma once

#include <stop_token>
#include <string>

#include "app/train/resolved_run.h"
#include "app/train/trainer.h"
#include "learner/run/run_directory.h"
#include "metrics/exposer.h"

namespace slalom::train {

/// Trains the stages of the run in `directory` that are not finished, and goes on with one that was
/// interrupted. A stage is finished if its policy was trained to a limit with the stage's config.
/// `commit`: as for `Trainer`. `exposer`, which may be null, shows the metrics of the stage that is
/// trained. Returns kFinished, or how the first stage that did not finish ended: kStopped or
/// kUnsaved. Throws `base::Error` that names the stage if it diverged or learned nothing, as
/// `RequireResumable` if its policy was trained with another config, and as `Trainer` does.
/// Requires: this process holds the lock of the run.
TrainingEnd TrainStages(const ResolvedRun& config, const run::RunDirectory& directory,
                        const std::string& commit, metrics::Exposer* exposer,
                        const std::stop_token& stop);

}  // namespace slalom::train
