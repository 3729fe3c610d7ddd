#include "app/train/stage_trainer.h"

#include <fmt/format.h>

#include <cstddef>
#include <filesystem>
#include <vector>

#include "app/train/service_process.h"
#include "app/train/stages.h"
#include "base/error.h"
#include "base/log.h"
#include "base/progress.h"
#include "metrics/registry.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

/// A finished stage keeps no checkpoint, a stopped one does.
bool IsFinished(const run::RunDirectory& directory) {
  return fs::exists(directory.policy()) &&
         (!fs::exists(directory.checkpoints()) || fs::is_empty(directory.checkpoints()));
}

}  // namespace

TrainingEnd TrainStages(const RunConfig& config, const run::RunDirectory& directory,
                        const std::string& commit, const std::stop_token& stop) {
  const std::vector<Stage> stages = StagesOf(config);
  for (std::size_t i = 0; i < stages.size(); ++i) {
    const Stage& stage = stages[i];
    const run::RunDirectory own{StageDirectory(directory.root, stage.name)};
    if (IsFinished(own)) continue;
    spdlog::info("teacher {} of {} for {}: stage {}, training on {}", i + 1, stages.size(),
                 directory.root.string(), stage.name, stage.config.courses.DescribeTrain());
    metrics::Registry registry(MakeIdentity("train", stage.name, stage.name));
    Trainer trainer(stage.config, own, commit, fs::exists(own.config()), registry);
    const TrainingEnd end = trainer.Run(stop);
    switch (end) {
      case TrainingEnd::kFinished:
      case TrainingEnd::kWasFinished:
        break;
      case TrainingEnd::kStopped:
      case TrainingEnd::kUnsaved:
        return end;
      case TrainingEnd::kDiverged:
      case TrainingEnd::kLearnedNothing:
        throw base::Error(
            fmt::format("{}: the stage {}; expected a policy that can teach", own.root.string(),
                        end == TrainingEnd::kDiverged ? "diverged" : "learned nothing"));
    }
    spdlog::info("trained for {}: {} steps", base::FormatDuration(trainer.training_s()),
                 base::FormatCount(static_cast<double>(trainer.steps())));
  }
  return TrainingEnd::kFinished;
}

}  // namespace slalom::train
