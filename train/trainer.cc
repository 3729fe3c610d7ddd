#include "train/trainer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "base/progress.h"
#include "config/config.h"
#include "sim/scene.h"
#include "train/begin_run.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;
using std::chrono::steady_clock;

constexpr char kStateFile[] = "state.json";
constexpr char kActorFile[] = "actor.bin";
constexpr char kLearnerFile[] = "learner.safetensors";
constexpr char kActingFile[] = "acting.safetensors";
constexpr char kReplayFile[] = "replay.manifest";
constexpr char kReplayDirectory[] = "replay";

std::uint64_t Seed(const RunConfig& config, std::string_view purpose) {
  return base::DeriveSeed(static_cast<std::uint64_t>(config.run.seed), purpose);
}

run::RunLock Begin(const run::RunDirectory& directory, const RunConfig& config, bool resume) {
  return resume ? ResumeRun(directory, config) : BeginRun(directory, config);
}

const RunConfig& Checked(const RunConfig& config) {
  if (config.run.deterministic && config.run.max_seconds > 0.0) {
    throw base::Error(fmt::format(
        "run.max_seconds is {}, expected 0 in a deterministic run: what it learns in that time "
        "depends on the machine; end it by run.max_steps",
        config.run.max_seconds));
  }
  if (config.run.deterministic && config.method.learner.prioritized) {
    throw base::Error(
        "learner.prioritized is true, expected false in a deterministic run: priorities are not "
        "part of a checkpoint");
  }
  return config;
}

/// Of the state in `state.json`, as 16 hexadecimal digits.
std::string StateChecksum(const nlohmann::json& state) {
  return fmt::format("{:016x}", base::Checksum(std::string_view(state.dump())));
}

std::int64_t CountSteps(const replay::Chunk& chunk) {
  return std::count_if(chunk.flags.begin(), chunk.flags.end(),
                       [](std::uint8_t flags) { return (flags & replay::kRowFinal) == 0; });
}

}  // namespace

Trainer::Trainer(const RunConfig& config, const run::RunDirectory& directory, std::string commit,
                 bool resume, steady_clock::time_point begin)
    : config_(Checked(config)),
      commit_(std::move(commit)),
      begin_(begin),
      parallel_(config.run.deterministic ? 1 : config.run.simulation_threads),
      environments_(config.environment,
                    sim::MakeScenes(config.courses.Resolve(config.courses.train)),
                    config.actor.num_environments, &parallel_),
      learner_(config.method, MakePolicySpec(config), Seed(config, "learner")),
      agent_(learner_.Snapshot()),
      actor_(config.actor, environments_, agent_, Seed(config, "actor")),
      table_(config.replay, config.environment.lidar.num_beams),
      sampling_(Seed(config, "sampling")),
      limiter_(config.run.updates_per_step, config.run.learning_starts),
      directory_(directory),
      lock_(Begin(directory, config, resume)),
      store_(directory.checkpoints()),
      storage_(directory.checkpoints() / kReplayDirectory) {
  if (resume) Restore();
  if (config_.method.learner.prioritized)
    table_.UsePriorities(config_.replay_server.priority_exponent);
  metrics_ = std::make_unique<run::MetricsLog>(directory.metrics(), limiter_.steps());
  last_row_.training_s = training_s();
  last_row_.steps = limiter_.steps();
  last_row_.updates = limiter_.updates();
}

Trainer::~Trainer() = default;

double Trainer::training_s() const {
  return earlier_s_ + std::chrono::duration<double>(steady_clock::now() - begin_).count();
}

TrainingEnd Trainer::Run(std::stop_token stop) {
  try {
    return Train(stop);
  } catch (const base::Error&) {
    // The actor refuses what a network chooses that diverged since the last look at it.
    if (IsWell()) throw;
    return TrainingEnd::kDiverged;
  }
}

TrainingEnd Trainer::Train(std::stop_token stop) {
  StartCollector();
  base::ProgressLine progress;
  while (!AtLimit() && !stop.stop_requested()) {
    if (limiter_.update_due()) {
      Update();
    } else {
      // No update is due here, so a checkpoint by steps falls on the same place in every run.
      if (CheckpointDue()) TryCheckpoint();
      KeepSnapshots();
      Collect();
    }
    const double now = training_s();
    if (now - last_row_.training_s < config_.run.log_interval) continue;
    if (!Log()) return TrainingEnd::kDiverged;
    progress.Show(run::FormatProgress(last_row_, RemainingSeconds()), now);
  }
  StopCollector();
  if (!Log()) return TrainingEnd::kDiverged;
  KeepSnapshots();
  progress.End();
  Checkpoint();
  policy::SavePolicy(directory_.policy(), learner_.BestSnapshot(), Provenance());
  return AtLimit() ? TrainingEnd::kFinished : TrainingEnd::kStopped;
}

void Trainer::StartCollector() {
  const int num_beams = table_.num_beams();
  if (config_.run.deterministic) {
    collector_ = std::make_unique<InlineCollector>(actor_, agent_, num_beams);
  } else {
    collector_ =
        std::make_unique<ThreadedCollector>(actor_, agent_, num_beams, config_.run.queue_length);
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
  limiter_.AddSteps(CountSteps(*chunk));
  collector_->Recycle(std::move(chunk));
}

void Trainer::Update() {
  limiter_.AddUpdate();
  const auto specs = learner_.sample_specs();
  rows_.resize(specs.size());
  for (std::size_t i = 0; i < specs.size(); ++i) {
    if (!table_.SampleRows(specs[i], sampling_, &rows_[i])) return;
  }
  learner_.Update(rows_, Fraction());
  if (config_.method.learner.prioritized)
    table_.SetPriorities(rows_[0].sequence, learner_.Errors());
  if (limiter_.updates() % config_.run.publish_interval != 0) return;
  const actor::ActorStats acting = actor_.stats();
  learner_.ObserveEpisodes(acting.collision_rate, acting.num_episodes);
  collector_->Publish(learner_.Snapshot());
}

bool Trainer::AtLimit() const {
  return limiter_.steps() >= config_.run.max_steps ||
         (config_.run.max_seconds > 0.0 && training_s() >= config_.run.max_seconds);
}

double Trainer::Fraction() const {
  const double by_steps =
      static_cast<double>(limiter_.steps()) / static_cast<double>(config_.run.max_steps);
  const double by_time =
      config_.run.max_seconds > 0.0 ? training_s() / config_.run.max_seconds : 0.0;
  return std::min(1.0, std::max(by_steps, by_time));
}

double Trainer::RemainingSeconds() const {
  const double done = Fraction();
  return done > 0.0 ? training_s() * (1.0 / done - 1.0) : -1.0;
}

bool Trainer::Log() {
  const learner::LearnerStats learning = learner_.ReadStats();
  const actor::ActorStats acting = actor_.stats();
  run::MetricsRow row;
  row.training_s = training_s();
  row.steps = limiter_.steps();
  row.updates = limiter_.updates();
  row.episodes = acting.num_episodes;
  const double elapsed = std::max(1e-9, row.training_s - last_row_.training_s);
  row.steps_per_s = static_cast<double>(row.steps - last_row_.steps) / elapsed;
  row.updates_per_s = static_cast<double>(row.updates - last_row_.updates) / elapsed;
  const auto known = [&acting](double value) {
    return acting.num_recent > 0 ? value : std::numeric_limits<double>::quiet_NaN();
  };
  row.success_rate = known(acting.success_rate);
  row.collision_rate = known(acting.collision_rate);
  row.timeout_rate = known(acting.timeout_rate);
  row.mean_return = known(acting.mean_return);
  row.mean_episode_steps = known(acting.mean_length);
  row.critic_loss = learning.critic_loss;
  row.mean_q = learning.q_mean;
  row.actor_q = learning.actor_q_mean;
  row.critic_gradient_norm = learning.critic_gradient_norm;
  row.actor_gradient_norm = learning.actor_gradient_norm;
  row.replay_steps = table_.num_steps();
  metrics_->Append(row);
  last_row_ = row;
  return IsWell();
}

bool Trainer::IsWell() const {
  const auto fault = learner_.FindFault();
  if (!fault) return true;
  spdlog::error(
      "training diverged at {} steps, {} updates: {}; the last good checkpoint is kept in {}",
      limiter_.steps(), limiter_.updates(), *fault, directory_.checkpoints().string());
  return false;
}

void Trainer::KeepSnapshots() {
  const auto due = [this](auto times, double now) {
    // Thresholds passed since the last snapshot of their kind; several at once give one file.
    return std::any_of(times.begin(), times.end(), [&](double at) {
      const double last = std::is_same_v<typename decltype(times)::value_type, int>
                              ? static_cast<double>(last_snapshot_steps_)
                              : last_snapshot_s_;
      return at > last && at <= now;
    });
  };
  const double now = training_s();
  const bool by_time = due(config_.run.snapshot_seconds, now);
  const bool by_steps = due(config_.run.snapshot_steps, static_cast<double>(limiter_.steps()));
  last_snapshot_s_ = now;
  last_snapshot_steps_ = limiter_.steps();
  if (!by_time && !by_steps) return;
  base::MakeDirectories(directory_.snapshots());
  const fs::path path =
      directory_.snapshots() / fmt::format("step-{:012}.safetensors", limiter_.steps());
  policy::SavePolicy(path, learner_.BestSnapshot(), Provenance());
}

policy::Metadata Trainer::Provenance() const {
  return {{"config", config::ToToml(config_)},
          {"commit", commit_},
          {"seed", fmt::format("{}", config_.run.seed)},
          {"steps", fmt::format("{}", limiter_.steps())},
          {"updates", fmt::format("{}", limiter_.updates())},
          {"training_s", fmt::format("{:.2f}", training_s())}};
}

bool Trainer::CheckpointDue() const {
  const std::int64_t every_steps = config_.run.checkpoint_steps;
  if (every_steps > 0 && limiter_.steps() / every_steps != last_checkpoint_steps_ / every_steps) {
    return true;
  }
  const double every_s = config_.run.checkpoint_seconds;
  return every_s > 0.0 && !config_.run.deterministic &&
         training_s() - last_checkpoint_s_ >= every_s;
}

void Trainer::TryCheckpoint() {
  StopCollector();
  try {
    if (learner_.healthy()) Checkpoint();
  } catch (const base::Error& error) {
    spdlog::error("checkpoint not saved: {}; training goes on, the earlier one is kept",
                  error.what());
  }
  last_checkpoint_s_ = training_s();
  last_checkpoint_steps_ = limiter_.steps();
  StartCollector();
}

void Trainer::Checkpoint() {
  const std::string manifest = storage_.Save(table_);
  store_.Write(limiter_.steps(), [&](const fs::path& directory) {
    policy::TensorMap tensors;
    learner_.SaveState(tensors);
    policy::SaveTensors(directory / kLearnerFile, tensors, {});
    policy::SavePolicy(directory / kActingFile, agent_.snapshot(), {});
    base::WriteFileAtomically(directory / kActorFile, actor_.Save().Serialize());
    base::WriteFileAtomically(directory / kReplayFile, manifest);
    const nlohmann::json state = {{"steps", limiter_.steps()},
                                  {"updates", limiter_.updates()},
                                  {"training_s", training_s()},
                                  {"acting_version", agent_.snapshot().version},
                                  {"sampling", sampling_.state()}};
    const nlohmann::json file = {{"state", state}, {"checksum", StateChecksum(state)}};
    base::WriteFileAtomically(directory / kStateFile, file.dump(1) + "\n");
  });
  std::vector<std::string> manifests;
  for (const fs::path& checkpoint : store_.List()) {
    manifests.push_back(base::ReadFile(checkpoint / kReplayFile));
  }
  storage_.Commit(manifests);
}

void Trainer::Restore() {
  const auto checkpoints = store_.List();
  if (checkpoints.empty()) {
    spdlog::warn("{}: no checkpoint yet, the run begins anew", store_.directory().string());
    return;
  }
  std::vector<fs::path> damaged;
  for (const fs::path& checkpoint : checkpoints) {
    try {
      RestoreFrom(checkpoint);
      for (const fs::path& newer : damaged) store_.SetAside(newer);
      spdlog::info("resumed from {} ({} steps, {})", checkpoint.string(),
                   base::FormatCount(static_cast<double>(limiter_.steps())),
                   base::FormatDuration(earlier_s_));
      return;
    } catch (const base::Error& error) {
      if (checkpoint == checkpoints.back()) throw;
      spdlog::error("{}; trying the checkpoint before it", error.what());
      damaged.push_back(checkpoint);
    }
  }
}

void Trainer::RestoreFrom(const fs::path& checkpoint) {
  const fs::path state_path = checkpoint / kStateFile;
  double earlier_s = 0.0;
  std::int64_t steps = 0;
  std::int64_t updates = 0;
  base::Random::State sampling{};
  try {
    const auto file = nlohmann::json::parse(base::ReadFile(state_path));
    const auto& state = file.at("state");
    if (file.at("checksum").get<std::string>() != StateChecksum(state)) {
      throw base::Error(fmt::format("{}: its checksum does not match; the checkpoint is damaged",
                                    state_path.string()));
    }
    steps = state.at("steps").get<std::int64_t>();
    updates = state.at("updates").get<std::int64_t>();
    earlier_s = state.at("training_s").get<double>();
    sampling = state.at("sampling").get<base::Random::State>();
  } catch (const nlohmann::json::exception& error) {
    throw base::Error(
        fmt::format("{}: not a checkpoint's state ({})", state_path.string(), error.what()));
  }
  const auto learner_state = policy::LoadTensors(checkpoint / kLearnerFile);
  const auto acting = policy::LoadPolicy(checkpoint / kActingFile);
  const fs::path actor_path = checkpoint / kActorFile;
  const auto actor_state =
      actor::ActorState::Parse(base::ReadFile(actor_path), actor_path.string());
  const fs::path replay_path = checkpoint / kReplayFile;
  table_ = storage_.Load(base::ReadFile(replay_path), replay_path.string());
  learner_.LoadState(learner_state);
  agent_.SetSnapshot(acting.snapshot);
  actor_.Restore(actor_state);
  limiter_.Restore(steps, updates);
  sampling_.set_state(sampling);
  earlier_s_ = earlier_s;
  last_checkpoint_s_ = earlier_s;
  last_checkpoint_steps_ = steps;
  last_snapshot_s_ = earlier_s;
  last_snapshot_steps_ = steps;
}

}  // namespace slalom::train
