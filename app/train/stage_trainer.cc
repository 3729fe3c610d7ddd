#include "app/train/stage_trainer.h"

#include <cstddef>
#include <filesystem>
#include <memory>
#include <system_error>

#include "app/train/begin_run.h"
#include "app/train/service_process.h"
#include "app/train/trained_policy.h"
#include "base/error.h"
#include "base/log.h"
#include "base/progress.h"
#include "metrics/registry.h"
#include "policy/policy.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

/// Whether the policy in the directory of a stage was trained to its end. Throws `base::Error` if
/// it was trained with another config.
bool IsFinished(const Stage& stage, const run::RunDirectory& directory) {
  const fs::path file = directory.policy();
  if (!fs::exists(file)) return false;
  const nn::Metadata metadata = policy::LoadPolicy(file).metadata;
  const auto trained = metadata.find("config");
  base::ThrowIf(trained == metadata.end(), "{}: carries no config, expected the policy of stage {}",
                file.string(), stage.name);
  const std::string source = file.string() + " (its config)";
  RequireResumable(trained->second, source, stage.config);
  // Its own limits, since those of the run may have been raised since.
  return IsAtLimit(FiguresOf(metadata), ReadRecordedConfig(trained->second, source).run);
}

}  // namespace

TrainingEnd TrainStages(const ResolvedRun& config, const run::RunDirectory& directory,
                        const std::string& commit, metrics::Exposer* exposer,
                        const std::stop_token& stop) {
  for (std::size_t i = 0; i < config.stages.size(); ++i) {
    const Stage& stage = config.stages[i];
    const run::RunDirectory own{StageDirectory(directory.root, stage.name)};
    if (IsFinished(stage, own)) {
      std::error_code ignored;  // A process that was killed may have left them.
      if (stage.config.run.keep_checkpoints == run::KeepCheckpoints::kNone) {
        fs::remove_all(own.checkpoints(), ignored);
      }
      continue;
    }
    spdlog::info("teacher {} of {} for {}: stage {}, training on {}", i + 1, config.stages.size(),
                 directory.root.string(), stage.name, stage.config.courses.DescribeTrain());
    const auto registry =
        std::make_shared<metrics::Registry>(MakeIdentity("train", stage.name, config.run.name));
    if (exposer != nullptr) exposer->Show(registry);
    Trainer trainer(stage.config, own, commit, fs::exists(own.config()), *registry);
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
        throw base::Error("{}: the stage {}; expected a policy that can teach", own.root.string(),
                          end == TrainingEnd::kDiverged ? "diverged" : "learned nothing");
    }
    spdlog::info("trained for {}: {} steps", base::FormatDuration(trainer.training_s()),
                 base::FormatCount(static_cast<double>(trainer.steps())));
  }
  return TrainingEnd::kFinished;
}

}  // namespace slalom::train
