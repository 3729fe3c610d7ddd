#include "app/train/table_source.h"

#include <chrono>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "app/train/begin_run.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "base/json.h"
#include "learner/run/run_directory.h"
#include "metrics/catalogue.h"
#include "policy/policy_spec.h"

namespace slalom::train {
namespace {

namespace fs = std::filesystem;

constexpr char kConfigKey[] = "config";  // In the acting policy's metadata.
constexpr char kReplayDirectory[] = "replay";
const std::string kLearner = "learner";  // The limiter's only one.

}  // namespace

TableSource::TableSource(const RunConfig& config, std::vector<replay::SampleSpec> specs,
                         actor::Actor& actor, policy::PolicyAgent& agent, replay::Table& table,
                         const fs::path& checkpoints, metrics::Registry& registry)
    : config_(config),
      specs_(std::move(specs)),
      actor_(actor),
      agent_(agent),
      table_(table),
      storage_(checkpoints / kReplayDirectory),
      registry_(registry),
      batches_(registry.counter(metrics::kBatches)),
      waited_(registry.counter(metrics::kBlockedSeconds, {metrics::queue::kBatches})),
      rows_(specs_.size()),
      sampling_(SeedOf(config, "sampling")),
      diagnostics_(SeedOf(config, "diagnostics")) {
  ResetLimiter(0, 0);
  if (specs_[0].prioritized) table_.UsePriorities(config.replay_server.priority_exponent);
}

void TableSource::ResetLimiter(std::int64_t steps, std::int64_t updates) {
  limiter_.emplace(replay::RateLimiter::Options{.updates_per_step = config_.run.updates_per_step,
                                                .learning_starts = config_.run.learning_starts},
                   steps);
  limiter_->Ask(kLearner, static_cast<std::uint64_t>(updates));
}

void TableSource::Start() {
  if (collector_) return;
  const env::StepShape& shape = table_.shape();
  if (config_.run.deterministic) {
    collector_ = std::make_unique<InlineCollector>(actor_, agent_, shape);
  } else {
    collector_ =
        std::make_unique<ThreadedCollector>(actor_, agent_, shape, config_.run.queue_length);
  }
}

void TableSource::Stop() {
  if (!collector_) return;
  collector_->Stop();
  while (auto chunk = collector_->Next()) Insert(std::move(chunk));
  collector_.reset();
}

bool TableSource::IsAtRest() const { return !limiter_->MaySample(kLearner); }

const std::vector<replay::SampledRows>* TableSource::Next() {
  if (IsAtRest()) {
    const auto began = std::chrono::steady_clock::now();
    auto chunk = collector_->Next();
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - began;
    // In lockstep this thread has stepped the actor, so it did not wait.
    if (!config_.run.deterministic) waited_.Increment(seconds.count());
    if (chunk) Insert(std::move(chunk));
    return nullptr;
  }
  limiter_->Grant(kLearner);
  for (std::size_t i = 0; i < specs_.size(); ++i) {
    if (!table_.SampleRows(specs_[i], sampling_, &rows_[i])) return nullptr;
  }
  batches_.Increment(static_cast<double>(specs_.size()));
  return &rows_;
}

void TableSource::Insert(std::unique_ptr<replay::Chunk> chunk) {
  table_.Insert(*chunk);
  limiter_->AddSteps(chunk->num_steps());
  collector_->Recycle(std::move(chunk));
}

learner::EndedEpisodes TableSource::TakeEndedEpisodes() {
  const actor::ActorStats acting = actor_.stats();
  const std::int64_t before = std::exchange(observed_episodes_, acting.num_episodes);
  return {acting.num_recent > 0 ? acting.mean_cost : run::MetricsRow::kNone,
          acting.num_episodes - before};
}

void TableSource::SetPriorities(std::span<const std::int64_t> sequence,
                                std::span<const float> priority) {
  table_.SetPriorities(sequence, priority);
}

void TableSource::Publish(policy::PolicySnapshot acting, learner::ShippedPolicy, std::int64_t) {
  collector_->Publish(std::move(acting));
}

const replay::SampledRows* TableSource::SampleForFigures(const replay::SampleSpec& spec) {
  return table_.SampleRows(spec, diagnostics_, &windows_) ? &windows_ : nullptr;
}

void TableSource::Describe(run::MetricsRow& row) {
  const actor::ActorStats acting = actor_.stats();
  const auto known = [&acting](double value) {
    return acting.num_recent > 0 ? value : run::MetricsRow::kNone;
  };
  row.episodes = acting.num_episodes;
  row.success_rate = known(acting.success_rate);
  row.collision_rate = known(acting.collision_rate);
  row.timeout_rate = known(acting.timeout_rate);
  row.episode_return = known(acting.mean_return);
  row.episode_steps = known(acting.mean_length);
  row.courses = static_cast<double>(acting.sampling.num_courses);
  row.fresh_success = acting.sampling.mean_success;
  row.learnable_share = acting.sampling.learnable_share;
  row.table_steps = table_.num_steps();
}

void TableSource::Report(const run::MetricsRow& row, double, bool) {
  registry_.counter(metrics::kEnvironmentSteps).RaiseTo(static_cast<double>(row.steps));
  registry_.gauge(metrics::kEnvironments).Set(config_.actor.num_environments);
  registry_.gauge(metrics::kSuccessRate).Set(row.success_rate);
  registry_.gauge(metrics::kCollisionRate).Set(row.collision_rate);
  registry_.gauge(metrics::kEpisodeReturn).Set(row.episode_return);
  registry_.gauge(metrics::kEpisodeSteps).Set(row.episode_steps);
  registry_.gauge(metrics::kCoursesDriven).Set(row.courses);
  registry_.gauge(metrics::kFreshSuccess).Set(row.fresh_success);
  registry_.gauge(metrics::kLearnableShare).Set(row.learnable_share);
  registry_.gauge(metrics::kTableSteps).Set(static_cast<double>(row.table_steps));
  registry_.gauge(metrics::kTableRows).Set(static_cast<double>(table_.num_rows()));
  registry_.gauge(metrics::kTableCapacityRows).Set(static_cast<double>(config_.replay.capacity));
  registry_.gauge(metrics::kTableBytes).Set(static_cast<double>(table_.bytes()));
}

void TableSource::Save(const fs::path& checkpoint, nlohmann::json& state) {
  state["updates_due"] = static_cast<std::int64_t>(limiter_->granted());
  state["observed_episodes"] = observed_episodes_;
  state["sampling"] = sampling_.state();
  const run::CheckpointFiles files{checkpoint};
  base::WriteFileAtomically(files.replay(), storage_.Save(table_));
  if (table_.has_priorities()) {
    base::WriteFileAtomically(files.priorities(), table_.PrintPriorities());
  }
  policy::SavePolicy(files.acting(), agent_.snapshot(), {{kConfigKey, config::ToToml(config_)}});
  base::WriteFileAtomically(files.actor(), actor_.Save().Serialize());
}

void TableSource::Restore(const fs::path& checkpoint, const nlohmann::json& state) {
  const auto steps = base::WholeNumber(state.at("steps"));
  const auto updates = base::WholeNumber(state.at("updates_due"));
  const auto observed_episodes = base::WholeNumber(state.at("observed_episodes"));
  const auto sampling = state.at("sampling").get<base::Random::State>();
  const run::CheckpointFiles files{checkpoint};
  const std::string acting_path = files.acting().string();
  const auto acting = policy::LoadPolicy(acting_path);
  policy::RequireSameSpec(acting_path, acting.snapshot.spec, agent_.snapshot().spec);
  const auto config = acting.metadata.find(kConfigKey);
  base::ThrowIf(config == acting.metadata.end(), "{}: has no config; the checkpoint is damaged",
                acting_path);
  RequireResumable(config->second, acting_path + " (its config)", config_);
  const fs::path actor_path = files.actor();
  const auto actor_state =
      actor::ActorState::Parse(base::ReadFile(actor_path), actor_path.string());
  const fs::path replay_path = files.replay();
  table_ = storage_.Load(base::ReadFile(replay_path), replay_path.string());
  RestorePriorities(files.priorities());
  agent_.SetSnapshot(acting.snapshot);
  actor_.Restore(actor_state);
  ResetLimiter(steps, updates);
  observed_episodes_ = observed_episodes;
  sampling_.set_state(sampling);
}

void TableSource::RestorePriorities(const fs::path& file) {
  if (!specs_[0].prioritized) return;
  const double alpha = config_.replay_server.priority_exponent;
  if (const auto failure = table_.RestorePriorities(base::ReadFile(file), alpha)) {
    throw base::Error("{}: damaged: {}; the checkpoint is damaged", file.string(), failure->text);
  }
}

void TableSource::KeepOnly(const std::vector<fs::path>& checkpoints) {
  std::vector<std::string> manifests;
  manifests.reserve(checkpoints.size());
  for (const fs::path& checkpoint : checkpoints) {
    manifests.push_back(base::ReadFile(run::CheckpointFiles{checkpoint}.replay()));
  }
  storage_.Commit(manifests);
}

}  // namespace slalom::train
