#include "app/train/trainer.h"

#include <filesystem>
#include <utility>

#include "app/train/begin_run.h"
#include "app/train/course_teachers.h"
#include "app/train/disk_room.h"
#include "app/train/inputs.h"
#include "base/config.h"
#include "base/error.h"
#include "base/log.h"

namespace slalom::train {
namespace {

/// Size of the learner's state in a checkpoint.
std::int64_t StateBytes(const learner::Learner& learner) {
  nn::TensorMap tensors;
  learner.SaveState(tensors);
  std::int64_t bytes = 0;
  for (const auto& [name, tensor] : tensors) {
    bytes += static_cast<std::int64_t>(tensor.bytes.size());
  }
  return bytes;
}

run::RunLock Begin(const run::RunDirectory& directory, const ResolvedRun& config,
                   const learner::Learner& learner, bool resume, std::optional<run::RunLock> held) {
  RequireRoom(config, directory, StateBytes(learner));
  if (held) return *std::move(held);
  return BeginTraining(directory, config, resume);
}

learner::MethodConfig MethodOf(const RunConfig& config) {
  learner::MethodConfig method = config.method;
  if (config.run.deterministic) method.learner.threads = 1;
  return method;
}

}  // namespace

Trainer::Trainer(const ResolvedRun& config, const run::RunDirectory& directory, std::string commit,
                 bool resume, metrics::Registry& registry, run::TrainingClock clock,
                 std::optional<run::RunLock> held)
    : config_(config),
      parallel_(config.run.deterministic ? 1 : config.run.simulation_threads),
      environments_(MakeTrainingEnvironments(config, parallel_)),
      learner_(MethodOf(config), MakePolicySpec(config), SeedOf(config, "learner"),
               LoadFirstPolicy(config)),
      agent_(policy::MakePolicyAgent(learner_.Snapshot(), config.mpc, SeedOf(config, "mpc"))),
      teachers_(MakeTeachers(config, directory.root)),
      actor_(config.actor, environments_, *agent_, SeedOf(config, "actor"), config.courses.sampling,
             teachers_.get()),
      table_(config.replay, StepShapeOf(config)),
      lock_(Begin(directory, config, learner_, resume, std::move(held))),
      source_(config, learner_.sample_specs(), actor_, *agent_, table_, directory.checkpoints(),
              registry),
      loop_({.run = {directory, config.run, config::ToToml<RunConfig>(config), std::move(commit),
                     run::Fence::OfEnvironment()}},
            learner_, source_, source_, registry, std::move(clock)) {
  if (!resume || loop_.Restore()) return;
  base::ThrowIf(
      std::filesystem::exists(directory.policy()),
      "{}: no checkpoint to go on from, and {} would be overwritten; with --force in place of "
      "--resume the run there is moved aside and a new one begins",
      directory.checkpoints().string(), directory.policy().string());
  if (!config_.stages.empty()) return;  // Its stages have been trained up to here.
  spdlog::info("{}: no checkpoint yet, the run starts from the beginning",
               directory.checkpoints().string());
}

Trainer::~Trainer() = default;

TrainingEnd Trainer::Run(std::stop_token stop) {
  const TrainingEnd end = loop_.Run(stop);
  const run::KeepCheckpoints kept = config_.run.keep_checkpoints;
  const bool is_finished = end == TrainingEnd::kFinished || end == TrainingEnd::kWasFinished;
  if (is_finished && kept != run::KeepCheckpoints::kAll) {
    loop_.KeepCheckpoints(kept == run::KeepCheckpoints::kNewest ? 1 : 0);
    if (kept == run::KeepCheckpoints::kNone) source_.DeleteSaved();
  }
  return end;
}

}  // namespace slalom::train
