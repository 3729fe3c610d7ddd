#include "learner/service/learner_service.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "base/progress.h"
#include "base/random.h"

namespace slalom::learner {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

// Longest wait for a batch before policies are looked after.
constexpr milliseconds kBatchWait{5};
constexpr milliseconds kServeWait{100};
// A wait for a batch counts as training time up to this [s]: the rate limiter holds batches back
// for moments while actors make the steps that earn them. A longer one is an outage, or a start.
constexpr double kCountedWaitS = 1.0;

std::uint64_t LearnerSeed(std::int64_t run_seed) {
  return base::DeriveSeed(static_cast<std::uint64_t>(run_seed), "learner");
}

proto::Hello MakeHello(const LearnerJob& job, const policy::PolicySpec& spec) {
  proto::Hello hello;
  hello.role = "learner";
  hello.name = job.name;
  hello.spec_hash = job.spec_hash;
  hello.num_beams = spec.observation.num_beams;
  return hello;
}

std::int64_t DirectoryBytes(const fs::path& directory) {
  std::int64_t bytes = 0;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(directory, ignored)) {
    bytes += static_cast<std::int64_t>(entry.file_size(ignored));
  }
  return bytes;
}

}  // namespace

LearnerService::LearnerService(const LearnerServiceConfig& config, const MethodConfig& method,
                               const policy::PolicySpec& spec, LearnerJob job,
                               transport::Context& context, metrics::Registry& registry,
                               run::TrainingClock clock)
    : config_(config),
      prioritized_(method.learner.prioritized),
      job_(std::move(job)),
      run_(job_.plan, method, spec, LearnerSeed(job_.plan.seed), std::move(clock)),
      policies_(context, job_.policies, job_.spec_hash, registry),
      metrics_(registry) {
  run_.Open();
  Restore();
  run_.OpenLog();
  batches_ = std::make_unique<BatchStream>(context, job_.replay, MakeHello(job_, spec),
                                           run_.learner().sample_specs(), config.prefetch, cursor_);
  Publish();
}

LearnerEnd LearnerService::Run(std::stop_token stop) {
  base::ProgressLine progress;
  while (!stop.stop_requested() && !(finished_ && config_.exit_when_finished)) {
    const auto waiting = steady_clock::now();
    if (finished_) {
      policies_.Poll(kServeWait);
      batches_->link().Receive(milliseconds(0));
    } else if (const RemoteBatches* batches = batches_->Next(kBatchWait)) {
      waited_s_ += std::chrono::duration<double>(steady_clock::now() - waiting).count();
      run_.StartClock();
      waiting_since_s_.reset();
      LearnFrom(*batches);
    } else {
      waited_s_ += std::chrono::duration<double>(steady_clock::now() - waiting).count();
      if (!waiting_since_s_) waiting_since_s_ = run_.wall_s();
      if (run_.wall_s() - *waiting_since_s_ >= kCountedWaitS) run_.StopClock();
      Say(batches_->link().welcomed() ? "" : "waiting for the replay server");
    }
    policies_.Poll(milliseconds(0));
    PublishIfDue();
    run_.LookAtClock();
    if (run_.LogDue()) {
      if (!Log()) return LearnerEnd::kDiverged;
      if (!finished_) progress.Show(run_.Progress(), run_.wall_s());
    }
    if (finished_) continue;
    run_.KeepSnapshots();
    if (job_.checkpoint_seconds > 0.0 && run_.since_checkpoint_s() >= job_.checkpoint_seconds) {
      TryCheckpoint();
    }
    if (run_.AtLimit()) {
      run_.StopClock();
      progress.End();
      if (!run_.IsWell()) return LearnerEnd::kDiverged;
      finished_ = true;
      TryCheckpoint();
      Publish();
      run_.SavePolicy();
      spdlog::info("trained for {}: {} steps, {} updates; policy: {}",
                   base::FormatDuration(run_.training_s()),
                   base::FormatCount(static_cast<double>(run_.steps())),
                   base::FormatCount(static_cast<double>(updates())),
                   job_.plan.directory.policy().string());
      if (const std::string fault = run_.watch().fault(); !fault.empty()) {
        spdlog::warn("the run may have learned nothing: {}", fault);
      }
    }
  }
  progress.End();
  if (!finished_) {
    if (!run_.IsWell()) return LearnerEnd::kDiverged;
    Checkpoint();
    run_.SavePolicy();
  }
  return LearnerEnd::kStopped;
}

void LearnerService::LearnFrom(const RemoteBatches& batches) {
  run_.SetSteps(batches.header.inserted_steps);
  table_steps_ = batches.header.table_steps;
  acting_version_ = batches.header.acting_version;
  const auto began = steady_clock::now();
  run_.learner().Update(batches.rows, run_.Fraction());
  if (prioritized_) batches_->SetPriorities(batches.rows[0].sequence, run_.learner().TdErrors());
  metrics_.AddBatch();
  metrics_.AddUpdate(std::chrono::duration<double>(steady_clock::now() - began).count());
}

void LearnerService::PublishIfDue() {
  if (updates() - published_updates_ < job_.publish_interval ||
      steady_clock::now() - published_at_ <
          std::chrono::duration<double>(config_.publish_seconds)) {
    return;
  }
  Publish();
}

void LearnerService::Publish() {
  const policy::PolicySnapshot snapshot = run_.learner().Snapshot();
  policies_.Publish(snapshot.version,
                    transport::Frame::Copy(std::string_view(policy::PrintPolicy(snapshot, {}))),
                    run_.steps());
  published_updates_ = snapshot.version;
  published_at_ = steady_clock::now();
}

bool LearnerService::Log() {
  const proto::StatusReply status = batches_->status().value_or(proto::StatusReply{});
  batches_->AskStatus();
  const ActorFigures acting = Summarise(status);
  run_.learner().ObserveEpisodes(acting.collision_rate, finished_episodes_.Take(status));
  run::MetricsRow row;
  row.episodes = acting.num_episodes;
  row.success_rate = acting.success_rate;
  row.collision_rate = acting.collision_rate;
  row.timeout_rate = acting.timeout_rate;
  row.mean_return = acting.mean_return;
  row.mean_episode_steps = acting.mean_length;
  row.replay_steps = table_steps_;
  if (const replay::SampledRows* windows = batches_->TakeWindows()) {
    model_steps_error_ = run_.learner().PredictionError(*windows);
  }
  if (run_.learner().has_model() && !finished_) batches_->AskWindows(run_.learner().window_spec());
  row.model_steps_error = model_steps_error_;
  row = run_.Complete(row);
  const double lag = static_cast<double>(published_updates_) - acting_version_;
  metrics_.SetLearning(row);
  metrics_.SetFinished(finished_);
  metrics_.SetStream(batches_->in_flight(), lag, batches_->link().connections());
  metrics_.AddWait(waited_s_);
  waited_s_ = 0.0;
  proto::Report report;
  report.role = "learner";
  report.name = job_.name;
  report.figures = {{"updates", static_cast<double>(row.updates)},
                    {"updates_per_s", row.updates_per_s},
                    {"policy_version", static_cast<double>(published_updates_)},
                    {"policy_lag", lag},
                    {"readers", static_cast<double>(policies_.num_readers())},
                    {"critic_loss", row.critic_loss},
                    {"mean_q", row.mean_q}};
  report.facts = {{"state", finished_ ? "finished" : "training"}};
  batches_->link().ReportEverySecond([&] { return report; });
  if (finished_) return true;
  // While the learner waits for the replay server there is nothing new to write down.
  if (row.training_s > appended_at_s_) run_.Append(row);
  appended_at_s_ = row.training_s;
  return run_.IsWell();
}

void LearnerService::TryCheckpoint() {
  run_.MarkCheckpoint();
  if (!run_.learner().healthy()) return;
  try {
    Checkpoint();
  } catch (const base::Error& error) {
    metrics_.AddFailedCheckpoint();
    spdlog::error("checkpoint not saved: {}; training goes on, the earlier one is kept",
                  error.what());
  }
}

void LearnerService::Checkpoint() {
  const auto began = steady_clock::now();
  // By updates, as they rise with each checkpoint that says something new.
  run_.Checkpoint(updates(), {{"cursor", batches_->cursor()}, {"finished", finished_}},
                  [](const fs::path&) {});
  metrics_.AddCheckpoint(std::chrono::duration<double>(steady_clock::now() - began).count(),
                         DirectoryBytes(run_.store().List().front()), updates());
}

void LearnerService::Restore() {
  bool finished = false;
  run_.Restore([&](const fs::path&, const nlohmann::json& state) {
    cursor_ = state.at("cursor").get<std::uint64_t>();
    finished = state.at("finished").get<bool>();
  });
  finished_ = finished && run_.AtLimit();
  appended_at_s_ = run_.training_s();
}

void LearnerService::Say(const std::string& what) {
  if (what == said_) return;
  said_ = what;
  if (!what.empty()) spdlog::info("{} at {}", what, job_.replay.endpoint);
}

}  // namespace slalom::learner
