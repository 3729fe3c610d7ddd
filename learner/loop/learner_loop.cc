#include "learner/loop/learner_loop.h"

#include <fmt/format.h>

#include <cmath>
#include <exception>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/clock.h"
#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "base/progress.h"
#include "learner/run/checkpoint_store.h"
#include "learner/run/run_directory.h"
#include "metrics/catalogue.h"
#include "metrics/learning_figures.h"

namespace slalom::learner {
namespace {

namespace fs = std::filesystem;
using std::chrono::steady_clock;

// A wait for another process counts as training time up to this [s]: a rate limiter holds batches
// back for moments while actors make the steps that earn them. A longer one is an outage.
constexpr double kCountedWaitS = 1.0;

}  // namespace

LearnerMetrics::LearnerMetrics(metrics::Registry& registry)
    : registry_(registry),
      updates_(registry.counter(metrics::kUpdates)),
      update_seconds_(registry.histogram(metrics::kUpdateSeconds)) {
  registry_.counter(metrics::kCheckpoints);
  registry_.counter(metrics::kCheckpointFailures);
  registry_.gauge(metrics::kCheckpointTimestamp).Set(base::UnixSeconds());
}

void LearnerMetrics::AddUpdate(double seconds) { update_seconds_.Observe(seconds); }

void LearnerMetrics::SetLearning(const run::MetricsRow& row) {
  updates_.RaiseTo(static_cast<double>(row.updates));
  if (row.updates_per_s > 0.0) metrics::ShowLearning(row.learning, registry_);
}

void LearnerMetrics::AddCheckpoint(double seconds, std::int64_t bytes, std::int64_t updates) {
  registry_.counter(metrics::kCheckpoints).Increment();
  registry_.gauge(metrics::kCheckpointTimestamp).Set(base::UnixSeconds());
  registry_.gauge(metrics::kCheckpointSeconds).Set(seconds);
  registry_.gauge(metrics::kCheckpointBytes).Set(static_cast<double>(bytes));
  registry_.gauge(metrics::kCheckpointUpdates).Set(static_cast<double>(updates));
}

void LearnerMetrics::AddFailedCheckpoint() {
  registry_.counter(metrics::kCheckpointFailures).Increment();
}

void LearnerMetrics::SetFinished(bool finished) {
  registry_.gauge(metrics::kRunFinished).Set(finished ? 1.0 : 0.0);
}

LearnerLoop::LearnerLoop(LoopPlan plan, Learner& learner, BatchSource& source, PolicySink& sink,
                         metrics::Registry& registry, run::TrainingClock clock)
    : plan_(std::move(plan)),
      learner_(learner),
      source_(source),
      sink_(sink),
      prioritized_(learner.sample_specs()[0].prioritized),
      run_(plan_.run, std::move(clock)),
      metrics_(registry) {}

bool LearnerLoop::Restore() {
  return run_.Restore([this](const fs::path& checkpoint, const nlohmann::json& state) {
    state.at("nothing_learned").get_to(had_learned_nothing_);
    state.at("unpublished").get_to(unpublished_);
    state.at("unobserved").get_to(unobserved_);
    const nn::TensorFile tensors = nn::LoadTensors(run::CheckpointFiles{checkpoint}.learner());
    source_.Restore(checkpoint, state);
    learner_.LoadState(tensors);
    return learner_.num_updates();
  });
}

TrainingEnd LearnerLoop::Run(std::stop_token stop) {
  try {
    return Train(stop);
  } catch (const base::Error&) {
    // An actor refuses the actions of a network that diverged since the last check.
    if (IsWell()) throw;
    return TrainingEnd::kDiverged;
  }
}

bool LearnerLoop::AtEnd() const {
  if (!run_.AtLimit()) return false;
  const run::RunSettings& settings = plan_.run.settings;
  const bool is_by_time = settings.max_seconds > 0.0 && run_.training_s() >= settings.max_seconds;
  if (!plan_.makes_all_updates || is_by_time) return true;
  const double earned = settings.updates_per_step *
                        static_cast<double>(settings.max_steps - settings.learning_starts);
  return static_cast<double>(source_.num_drawn()) >= std::floor(earned);
}

TrainingEnd LearnerLoop::Train(std::stop_token stop) {
  if (AtEnd()) return EndAgain();
  run_.OpenLog();
  spdlog::info("training in {}", plan_.run.directory.root.string());
  source_.Start();
  base::ProgressLine progress;
  CountTime();
  while (!AtEnd() && !stop.stop_requested()) {
    if (source_.IsAtRest()) {
      // A run that resumes from this checkpoint does not make this snapshot again.
      KeepSnapshot();
      if (run_.CheckpointDue()) TryCheckpoint();
    }
    Turn();
    if (!run_.LogDue()) continue;
    if (!Log()) return TrainingEnd::kDiverged;
    progress.Show(run_.Progress(), run_.wall_s());
  }
  const bool finished = AtEnd();
  source_.Stop();
  run_.SetProgress(source_.steps(), learner_.num_updates());
  run_.StopClock();
  if (!Log()) return TrainingEnd::kDiverged;
  finished_ = finished;
  metrics_.SetFinished(finished_);
  // If it stops with updates due, the run that goes on makes them first, and then the snapshot.
  if (finished || source_.IsAtRest()) KeepSnapshot();
  progress.Show(run_.Progress(), run_.wall_s());
  progress.End();
  if (finished && HasLearnedNothing()) {
    LastCheckpoint("");
    return TrainingEnd::kLearnedNothing;
  }
  // The policy comes first: it is small, and replay data may fill the disk. If one of the two
  // cannot be written, the other still is.
  std::exception_ptr no_policy;
  try {
    SavePolicy();
  } catch (const base::Error&) {
    no_policy = std::current_exception();
  }
  const bool saved = LastCheckpoint(
      no_policy ? "" : "; the policy is kept in " + plan_.run.directory.policy().string());
  if (no_policy) std::rethrow_exception(no_policy);
  if (!saved) return TrainingEnd::kUnsaved;
  return finished ? TrainingEnd::kFinished : TrainingEnd::kStopped;
}

TrainingEnd LearnerLoop::EndAgain() {
  finished_ = true;
  metrics_.SetFinished(true);
  if (run_.updates() == 0 || had_learned_nothing_) return TrainingEnd::kLearnedNothing;
  if (!HasNewestPolicy()) SavePolicy();
  return TrainingEnd::kWasFinished;
}

void LearnerLoop::Turn() {
  const auto* batches = source_.Next();
  run_.SetProgress(source_.steps(), learner_.num_updates());
  CountTime();
  if (batches) Learn(*batches);
  const int interval = plan_.run.settings.publish_interval;
  if (unobserved_ >= interval) {
    const EndedEpisodes ended = source_.TakeEndedEpisodes();
    learner_.ObserveEpisodes(ended.mean_cost, ended.count);
    unobserved_ = 0;
  }
  const bool may_publish =
      !published_at_ || base::SecondsSince(*published_at_) >= plan_.publish_seconds;
  if (unpublished_ >= interval && may_publish) Publish();
  sink_.Serve();
  run_.LookAtClock();
}

void LearnerLoop::Learn(const std::vector<replay::SampledRows>& batches) {
  const auto began = steady_clock::now();
  learner_.Update(batches, run_.Fraction());
  if (prioritized_) source_.SetPriorities(batches[0].sequence, learner_.TdErrors());
  metrics_.AddUpdate(base::SecondsSince(began));
  run_.SetProgress(run_.steps(), learner_.num_updates());
  ++unobserved_;
  ++unpublished_;
}

void LearnerLoop::CountTime() {
  if (!source_.IsWaiting()) {
    waiting_since_s_.reset();
    run_.StartClock();
    return;
  }
  if (!waiting_since_s_) waiting_since_s_ = run_.wall_s();
  if (run_.wall_s() - *waiting_since_s_ >= kCountedWaitS) run_.StopClock();
}

void LearnerLoop::Publish() {
  const auto shipped = [this](nn::Metadata metadata) {
    const policy::PolicySnapshot best = learner_.BestSnapshot();
    metadata.merge(run_.Provenance());
    return PolicyFile{best.version, policy::PrintPolicy(best, metadata)};
  };
  sink_.Publish(learner_.Snapshot(), shipped, run_.steps());
  unpublished_ = 0;
  published_at_ = steady_clock::now();
}

bool LearnerLoop::Log() {
  plan_.run.fence.RequireHeld();
  run::MetricsRow row;
  source_.Describe(row);
  row.learning = learner_.ReadStats();
  if (learner_.has_model() && !finished_) {
    if (const auto* windows = source_.SampleForFigures(learner_.window_spec())) {
      model_steps_error_ = learner_.PredictionError(*windows);
    }
  }
  row.learning.model.steps_error = model_steps_error_;
  row = run_.Log(row);
  metrics_.SetLearning(row);
  metrics_.SetFinished(finished_);
  source_.Report(row, run_.SecondsLeft(), finished_);
  return IsWell();
}

void LearnerLoop::ReportIfDue() {
  run_.LookAtClock();
  if (run_.LogDue()) static_cast<void>(Log());
}

bool LearnerLoop::IsWell() const {
  const auto fault = learner_.FindFault();
  if (!fault) return true;
  spdlog::error(
      "training diverged at {} steps, {} updates: {}; the last good checkpoint is kept in {}",
      run_.steps(), run_.updates(), *fault, plan_.run.directory.checkpoints().string());
  return false;
}

void LearnerLoop::KeepSnapshot() {
  if (!run_.TakeSnapshotDue()) return;
  plan_.run.fence.RequireHeld();
  try {
    const run::RunDirectory& directory = plan_.run.directory;
    base::MakeDirectories(directory.snapshots());
    policy::SavePolicy(directory.snapshot(run_.steps()), learner_.BestSnapshot(),
                       run_.Provenance());
  } catch (const base::Error& error) {
    spdlog::error("snapshot not kept: {}; training goes on", error.what());
  }
}

void LearnerLoop::TryCheckpoint() {
  plan_.run.fence.RequireHeld();
  source_.Stop();
  run_.SetProgress(source_.steps(), learner_.num_updates());
  try {
    if (learner_.healthy()) Checkpoint();
  } catch (const std::exception& error) {
    metrics_.AddFailedCheckpoint();
    spdlog::error("checkpoint not saved: {}; training goes on, the earlier one is kept",
                  error.what());
  }
  run_.MarkCheckpoint();
  source_.Start();
}

bool LearnerLoop::LastCheckpoint(const std::string& what_is_kept) {
  if (finished_ && plan_.lives_on) {
    TryCheckpoint();
    return true;
  }
  try {
    Checkpoint();
    return true;
  } catch (const std::exception& error) {
    metrics_.AddFailedCheckpoint();
    spdlog::error("the last checkpoint was not saved: {}{}", error.what(), what_is_kept);
    return false;
  }
}

void LearnerLoop::Checkpoint() {
  const auto began = steady_clock::now();
  const std::int64_t number = plan_.numbers_by_updates ? run_.updates() : run_.steps();
  const fs::path written =
      run_.Checkpoint(number, [this](const fs::path& directory, nlohmann::json& state) {
        nn::TensorMap tensors;
        learner_.SaveState(tensors);
        nn::SaveTensors(run::CheckpointFiles{directory}.learner(), tensors, {});
        state["unpublished"] = unpublished_;
        state["unobserved"] = unobserved_;
        state["nothing_learned"] = run_.watch().nothing_learned();
        source_.Save(directory, state);
        // Writing may have taken long.
        plan_.run.fence.RequireHeld();
      });
  metrics_.AddCheckpoint(base::SecondsSince(began), run::DirectoryBytes(written), run_.updates());
  KeepCheckpoints(run::CheckpointStore::kNumKept);
}

void LearnerLoop::KeepCheckpoints(std::size_t num_kept) {
  try {
    const std::vector<fs::path> kept = run_.KeepCheckpoints(num_kept);
    if (!kept.empty()) source_.KeepOnly(kept);
  } catch (const std::exception& error) {
    spdlog::warn("{}; what only older checkpoints needed stays until the next one", error.what());
  }
}

bool LearnerLoop::HasLearnedNothing() const {
  return run_.updates() == 0 || run_.watch().nothing_learned();
}

bool LearnerLoop::HasNewestPolicy() const {
  const fs::path path = plan_.run.directory.policy();
  try {
    return base::Exists(path) &&
           policy::LoadPolicy(path).metadata["updates"] == fmt::format("{}", run_.updates());
  } catch (const base::Error& error) {
    spdlog::warn("{}; it is written again", error.what());
    return false;
  }
}

void LearnerLoop::SavePolicy() const {
  plan_.run.fence.RequireHeld();
  try {
    policy::SavePolicy(plan_.run.directory.policy(), learner_.BestSnapshot(), run_.Provenance());
  } catch (const base::Error& error) {
    if (!finished_ || !plan_.lives_on) throw;
    spdlog::error("policy not saved: {}; it is served all the same", error.what());
  }
}

}  // namespace slalom::learner
