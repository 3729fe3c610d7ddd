#include "train/trainer.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "base/progress.h"
#include "config/config.h"
#include "policy/policy_spec.h"
#include "sim/scene.h"
#include "train/begin_run.h"
#include "train/run_limits.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

constexpr char kActorFile[] = "actor.bin";
constexpr char kActingFile[] = "acting.safetensors";
constexpr char kConfigKey[] = "config";  // In the acting policy's metadata.
constexpr char kReplayFile[] = "replay.manifest";
constexpr char kReplayDirectory[] = "replay";

std::uint64_t Seed(const RunConfig& config, std::string_view purpose) {
  return base::DeriveSeed(static_cast<std::uint64_t>(config.run.seed), purpose);
}

run::RunLock Begin(const run::RunDirectory& directory, const RunConfig& config, bool resume) {
  return resume ? ResumeRun(directory, config) : BeginRun(directory, config);
}

const RunConfig& Checked(const RunConfig& config, bool resume) {
  RequireCombination(config);
  // A resumed run has learned already, and may be given a limit that ends it at once.
  if (!resume) RequireLearnable(config);
  if (!config.run.deterministic) return config;
  if (const auto needed = OverridesForDeterminism(config); !needed.empty()) {
    throw base::Error(
        fmt::format("run.deterministic is true, expected with it {}", fmt::join(needed, ", ")));
  }
  return config;
}

learner::RunPlan MakePlan(const RunConfig& config, const run::RunDirectory& directory,
                          std::string commit) {
  return {.directory = directory,
          .config = config::ToToml(config),
          .commit = std::move(commit),
          .seed = config.run.seed,
          .max_steps = config.run.max_steps,
          .max_seconds = config.run.max_seconds,
          .log_interval = config.run.log_interval,
          .snapshot_seconds = config.run.snapshot_seconds,
          .snapshot_steps = config.run.snapshot_steps};
}

std::int64_t CountSteps(const replay::Chunk& chunk) {
  return std::count_if(chunk.flags.begin(), chunk.flags.end(),
                       [](std::uint8_t flags) { return (flags & replay::kRowFinal) == 0; });
}

}  // namespace

Trainer::Trainer(const RunConfig& config, const run::RunDirectory& directory, std::string commit,
                 bool resume, run::TrainingClock clock)
    : config_(Checked(config, resume)),
      directory_(directory),
      parallel_(config.run.deterministic ? 1 : config.run.simulation_threads),
      environments_(config.environment, sim::MakeScenes(config.courses.ResolveTrain()),
                    config.actor.num_environments, &parallel_),
      run_(MakePlan(config, directory, std::move(commit)), config.method, MakePolicySpec(config),
           Seed(config, "learner"), std::move(clock)),
      agent_(policy::MakePolicyAgent(run_.learner().Snapshot(), config.mpc, Seed(config, "mpc"))),
      actor_(config.actor, environments_, *agent_, Seed(config, "actor")),
      table_(config.replay, config.environment.lidar.num_beams),
      sampling_(Seed(config, "sampling")),
      diagnostics_(Seed(config, "diagnostics")),
      budget_(config.run.updates_per_step, config.run.learning_starts),
      lock_(Begin(directory, config, resume)),
      storage_(directory.checkpoints() / kReplayDirectory) {
  run_.Open();
  if (resume) Restore();
  if (config_.method.learner.prioritized) {
    table_.UsePriorities(config_.replay_server.priority_exponent);
  }
}

Trainer::~Trainer() = default;

TrainingEnd Trainer::Run(std::stop_token stop) {
  try {
    return Train(stop);
  } catch (const base::Error&) {
    // The actor refuses what a network chooses that diverged since the last look at it.
    if (run_.IsWell()) throw;
    return TrainingEnd::kDiverged;
  }
}

TrainingEnd Trainer::Train(std::stop_token stop) {
  if (run_.AtLimit()) {
    if (updates() == 0 || had_learned_nothing_) return TrainingEnd::kLearnedNothing;
    if (!HasNewestPolicy()) run_.SavePolicy();
    PruneCheckpoints();
    return TrainingEnd::kWasFinished;
  }
  run_.OpenLog();
  spdlog::info("training in {}", directory_.root.string());
  StartCollector();
  base::ProgressLine progress;
  run_.StartClock();
  while (!run_.AtLimit() && !stop.stop_requested()) {
    if (budget_.update_due()) {
      Update();
    } else {
      // No update is due here, so a checkpoint by steps falls on the same place in every run.
      // A run that resumes from this checkpoint does not make this snapshot again.
      run_.KeepSnapshots();
      if (CheckpointDue()) TryCheckpoint();
      Collect();
    }
    run_.LookAtClock();
    if (!run_.LogDue()) continue;
    if (!Log()) return TrainingEnd::kDiverged;
    progress.Show(run_.Progress(), run_.wall_s());
  }
  const bool finished = run_.AtLimit();
  StopCollector();
  run_.StopClock();
  if (!Log()) return TrainingEnd::kDiverged;
  run_.KeepSnapshots();
  progress.Show(run_.Progress(), run_.wall_s());
  progress.End();
  Checkpoint();
  if (finished && (updates() == 0 || watch().nothing_learned())) {
    return TrainingEnd::kLearnedNothing;
  }
  run_.SavePolicy();
  if (!finished) return TrainingEnd::kStopped;
  PruneCheckpoints();
  return TrainingEnd::kFinished;
}

void Trainer::StartCollector() {
  const int num_beams = table_.num_beams();
  if (config_.run.deterministic) {
    collector_ = std::make_unique<InlineCollector>(actor_, *agent_, num_beams);
  } else {
    collector_ =
        std::make_unique<ThreadedCollector>(actor_, *agent_, num_beams, config_.run.queue_length);
  }
}

void Trainer::StopCollector() {
  collector_->Stop();
  while (auto chunk = collector_->Next()) InsertChunk(std::move(chunk));
  collector_.reset();
}

void Trainer::Collect() {
  if (auto chunk = collector_->Next()) InsertChunk(std::move(chunk));
}

void Trainer::InsertChunk(std::unique_ptr<replay::Chunk> chunk) {
  table_.Insert(*chunk);
  budget_.AddSteps(CountSteps(*chunk));
  run_.SetSteps(budget_.steps());
  collector_->Recycle(std::move(chunk));
}

void Trainer::Update() {
  budget_.AddUpdate();
  learner::Learner& learner = run_.learner();
  const auto& specs = learner.sample_specs();
  rows_.resize(specs.size());
  for (std::size_t i = 0; i < specs.size(); ++i) {
    if (!table_.SampleRows(specs[i], sampling_, &rows_[i])) return;
  }
  learner.Update(rows_, run_.Fraction());
  if (config_.method.learner.prioritized) {
    table_.SetPriorities(rows_[0].sequence, learner.TdErrors());
  }
  if (budget_.updates() % config_.run.publish_interval != 0) return;
  const actor::ActorStats acting = actor_.stats();
  learner.ObserveEpisodes(acting.collision_rate, acting.num_episodes - observed_episodes_);
  observed_episodes_ = acting.num_episodes;
  collector_->Publish(learner.Snapshot());
}

bool Trainer::Log() {
  const actor::ActorStats acting = actor_.stats();
  const auto known = [&acting](double value) {
    return acting.num_recent > 0 ? value : run::MetricsRow::kNone;
  };
  run::MetricsRow row;
  row.episodes = acting.num_episodes;
  row.success_rate = known(acting.success_rate);
  row.collision_rate = known(acting.collision_rate);
  row.timeout_rate = known(acting.timeout_rate);
  row.mean_return = known(acting.mean_return);
  row.mean_episode_steps = known(acting.mean_length);
  row.replay_steps = table_.num_steps();
  const learner::Learner& learner = run_.learner();
  if (learner.has_model() && table_.SampleRows(learner.window_spec(), diagnostics_, &windows_)) {
    row.model_steps_error = learner.PredictionError(windows_);
  }
  run_.Append(run_.Complete(row));
  return run_.IsWell();
}

bool Trainer::CheckpointDue() const {
  const std::int64_t every_steps = config_.run.checkpoint_steps;
  if (every_steps > 0 && budget_.steps() / every_steps != last_checkpoint_steps_ / every_steps) {
    return true;
  }
  const double every_s = config_.run.checkpoint_seconds;
  return every_s > 0.0 && !config_.run.deterministic && run_.since_checkpoint_s() >= every_s;
}

void Trainer::TryCheckpoint() {
  StopCollector();
  try {
    if (run_.learner().healthy()) Checkpoint();
  } catch (const base::Error& error) {
    spdlog::error("checkpoint not saved: {}; training goes on, the earlier one is kept",
                  error.what());
  }
  run_.MarkCheckpoint();
  last_checkpoint_steps_ = budget_.steps();
  StartCollector();
}

void Trainer::Checkpoint() {
  const std::string manifest = storage_.Save(table_);
  const nlohmann::json state = {{"updates_due", budget_.updates()},
                                {"observed_episodes", observed_episodes_},
                                {"nothing_learned", watch().nothing_learned()},
                                {"sampling", sampling_.state()}};
  run_.Checkpoint(budget_.steps(), state, [&](const fs::path& directory) {
    policy::SavePolicy(directory / kActingFile, agent_->snapshot(),
                       {{kConfigKey, config::ToToml(config_)}});
    base::WriteFileAtomically(directory / kActorFile, actor_.Save().Serialize());
    base::WriteFileAtomically(directory / kReplayFile, manifest);
  });
  CommitReplay();
}

void Trainer::PruneCheckpoints() {
  const std::string& kept = config_.run.keep_checkpoints;
  if (kept == "all") return;
  run_.KeepCheckpoints(kept == "newest" ? 1 : 0);
  CommitReplay();
}

bool Trainer::HasNewestPolicy() const {
  const fs::path path = directory_.policy();
  return fs::exists(path) &&
         policy::LoadPolicy(path).metadata["updates"] == fmt::format("{}", updates());
}

void Trainer::CommitReplay() {
  std::vector<std::string> manifests;
  for (const fs::path& checkpoint : run_.store().List()) {
    manifests.push_back(base::ReadFile(checkpoint / kReplayFile));
  }
  storage_.Commit(manifests);
}

void Trainer::Restore() {
  const bool found = run_.Restore([this](const fs::path& checkpoint, const nlohmann::json& state) {
    ReadCheckpoint(checkpoint, state);
  });
  if (!found && fs::exists(directory_.policy())) {
    throw base::Error(fmt::format(
        "{}: no checkpoint to go on from, and {} would be overwritten; without --resume the run "
        "there is moved aside and a new one begins",
        directory_.checkpoints().string(), directory_.policy().string()));
  }
  if (!found) {
    spdlog::warn("{}: no checkpoint yet, the run begins anew", run_.store().directory().string());
  }
  last_checkpoint_steps_ = budget_.steps();
}

void Trainer::ReadCheckpoint(const fs::path& checkpoint, const nlohmann::json& state) {
  const auto steps = state.at("steps").get<std::int64_t>();
  const auto updates = state.at("updates_due").get<std::int64_t>();
  const auto observed_episodes = state.at("observed_episodes").get<std::int64_t>();
  const auto sampling = state.at("sampling").get<base::Random::State>();
  // Checkpoints from before do not say it.
  had_learned_nothing_ = state.value("nothing_learned", false);
  const std::string acting_path = (checkpoint / kActingFile).string();
  const auto acting = policy::LoadPolicy(acting_path);
  policy::RequireSameSpec(acting_path, acting.snapshot.spec, agent_->snapshot().spec);
  // Checkpoints from before do not say it.
  if (const auto config = acting.metadata.find(kConfigKey); config != acting.metadata.end()) {
    RequireResumable(config->second, acting_path + " (its config)", config_);
  }
  const fs::path actor_path = checkpoint / kActorFile;
  const auto actor_state =
      actor::ActorState::Parse(base::ReadFile(actor_path), actor_path.string());
  const fs::path replay_path = checkpoint / kReplayFile;
  table_ = storage_.Load(base::ReadFile(replay_path), replay_path.string());
  agent_->SetSnapshot(acting.snapshot);
  actor_.Restore(actor_state);
  budget_.Restore(steps, updates);
  observed_episodes_ = observed_episodes;
  sampling_.set_state(sampling);
}

}  // namespace slalom::train
