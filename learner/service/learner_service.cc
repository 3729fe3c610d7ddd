#include "learner/service/learner_service.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <type_traits>
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

constexpr char kStateFile[] = "state.json";
constexpr char kLearnerFile[] = "learner.safetensors";
// Longest wait for a batch before policies are looked after.
constexpr milliseconds kBatchWait{5};
constexpr milliseconds kServeWait{100};

std::uint64_t LearnerSeed(std::int64_t run_seed) {
  return base::DeriveSeed(static_cast<std::uint64_t>(run_seed), "learner");
}

/// Of the state in `state.json`, as 16 hexadecimal digits.
std::string StateChecksum(const nlohmann::json& state) {
  return fmt::format("{:016x}", base::Checksum(std::string_view(state.dump())));
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
                               transport::Context& context, metrics::Registry& registry)
    : config_(config),
      prioritized_(method.learner.prioritized),
      job_(std::move(job)),
      learner_(method, spec, LearnerSeed(job_.seed)),
      store_(job_.directory.checkpoints()),
      policies_(context, job_.policies, job_.spec_hash, registry),
      metrics_(registry),
      begin_(steady_clock::now()) {
  Restore();
  batches_ = std::make_unique<BatchStream>(context, job_.replay, MakeHello(job_, spec),
                                           learner_.sample_specs(), config.prefetch, cursor_);
  log_ = std::make_unique<run::MetricsLog>(job_.directory.metrics(), steps_);
  last_row_.training_s = training_s();
  last_row_.steps = steps_;
  last_row_.updates = updates();
  Publish();
}

double LearnerService::training_s() const {
  return earlier_s_ + std::chrono::duration<double>(steady_clock::now() - begin_).count();
}

double LearnerService::Fraction() const {
  const double by_steps = static_cast<double>(steps_) / static_cast<double>(job_.max_steps);
  const double by_time = job_.max_seconds > 0.0 ? training_s() / job_.max_seconds : 0.0;
  return std::clamp(std::max(by_steps, by_time), 0.0, 1.0);
}

bool LearnerService::AtLimit() const { return Fraction() >= 1.0; }

LearnerEnd LearnerService::Run(std::stop_token stop) {
  base::ProgressLine progress;
  while (!stop.stop_requested() && !(finished_ && config_.exit_when_finished)) {
    const auto waiting = steady_clock::now();
    if (finished_) {
      policies_.Poll(kServeWait);
      batches_->link().Receive(milliseconds(0));
    } else if (const RemoteBatches* batches = batches_->Next(kBatchWait)) {
      waited_s_ += std::chrono::duration<double>(steady_clock::now() - waiting).count();
      LearnFrom(*batches);
    } else {
      waited_s_ += std::chrono::duration<double>(steady_clock::now() - waiting).count();
      Say(batches_->link().welcomed() ? "" : "waiting for the replay server");
    }
    policies_.Poll(milliseconds(0));
    PublishIfDue();
    const double now = training_s();
    if (now - last_row_.training_s >= job_.log_interval) {
      if (!Log()) return LearnerEnd::kDiverged;
      const double done = Fraction();
      if (!finished_) {
        progress.Show(run::FormatProgress(last_row_, done > 0.0 ? now * (1.0 / done - 1.0) : -1.0),
                      now);
      }
    }
    if (finished_) continue;
    KeepSnapshots();
    if (job_.checkpoint_seconds > 0.0 && now - last_checkpoint_s_ >= job_.checkpoint_seconds) {
      TryCheckpoint();
    }
    if (AtLimit()) {
      progress.End();
      if (!IsWell()) return LearnerEnd::kDiverged;
      finished_ = true;
      TryCheckpoint();
      Publish();
      policy::SavePolicy(job_.directory.policy(), learner_.BestSnapshot(), Provenance());
      spdlog::info(
          "trained for {}: {} steps, {} updates; policy: {}", base::FormatDuration(training_s()),
          base::FormatCount(static_cast<double>(steps_)),
          base::FormatCount(static_cast<double>(updates())), job_.directory.policy().string());
    }
  }
  progress.End();
  if (!finished_) {
    if (!IsWell()) return LearnerEnd::kDiverged;
    Checkpoint();
    policy::SavePolicy(job_.directory.policy(), learner_.BestSnapshot(), Provenance());
  }
  return LearnerEnd::kStopped;
}

void LearnerService::LearnFrom(const RemoteBatches& batches) {
  steps_ = batches.header.inserted_steps;
  table_steps_ = batches.header.table_steps;
  acting_version_ = batches.header.acting_version;
  const auto began = steady_clock::now();
  learner_.Update(batches.rows, Fraction());
  if (prioritized_) batches_->SetPriorities(batches.rows[0].sequence, learner_.Errors());
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
  const policy::PolicySnapshot snapshot = learner_.Snapshot();
  policies_.Publish(snapshot.version,
                    transport::Frame::Copy(std::string_view(policy::PrintPolicy(snapshot, {}))),
                    steps_);
  published_updates_ = snapshot.version;
  published_at_ = steady_clock::now();
}

bool LearnerService::Log() {
  const LearnerStats learning = learner_.ReadStats();
  const ActorFigures acting = Summarise(batches_->status().value_or(proto::StatusReply{}));
  batches_->AskStatus();
  learner_.ObserveEpisodes(acting.collision_rate, acting.num_episodes);
  run::MetricsRow row;
  row.training_s = training_s();
  row.steps = steps_;
  row.updates = updates();
  row.episodes = acting.num_episodes;
  const double elapsed = std::max(1e-9, row.training_s - last_row_.training_s);
  row.steps_per_s = static_cast<double>(row.steps - last_row_.steps) / elapsed;
  row.updates_per_s = static_cast<double>(row.updates - last_row_.updates) / elapsed;
  row.success_rate = acting.success_rate;
  row.collision_rate = acting.collision_rate;
  row.timeout_rate = acting.timeout_rate;
  row.mean_return = acting.mean_return;
  row.mean_episode_steps = acting.mean_length;
  row.critic_loss = learning.critic_loss;
  row.mean_q = learning.q_mean;
  row.actor_q = learning.actor_q_mean;
  row.critic_gradient_norm = learning.critic_gradient_norm;
  row.actor_gradient_norm = learning.actor_gradient_norm;
  row.replay_steps = table_steps_;
  const double lag = static_cast<double>(published_updates_) - acting_version_;
  metrics_.SetLearning(updates(), learning);
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
  last_row_ = row;
  if (finished_) return true;
  log_->Append(row);
  return IsWell();
}

bool LearnerService::IsWell() const {
  const auto fault = learner_.FindFault();
  if (!fault) return true;
  spdlog::error(
      "training diverged at {} steps, {} updates: {}; the last good checkpoint is kept in {}",
      steps_, updates(), *fault, job_.directory.checkpoints().string());
  return false;
}

void LearnerService::KeepSnapshots() {
  const double now = training_s();
  const auto passed = [](const auto& times, auto last, auto current) {
    return std::any_of(times.begin(), times.end(), [&](auto at) {
      return static_cast<double>(at) > static_cast<double>(last) &&
             static_cast<double>(at) <= static_cast<double>(current);
    });
  };
  const bool due = passed(job_.snapshot_seconds, last_snapshot_s_, now) ||
                   passed(job_.snapshot_steps, last_snapshot_steps_, steps_);
  last_snapshot_s_ = now;
  last_snapshot_steps_ = steps_;
  if (!due) return;
  base::MakeDirectories(job_.directory.snapshots());
  policy::SavePolicy(job_.directory.snapshots() / fmt::format("step-{:012}.safetensors", steps_),
                     learner_.BestSnapshot(), Provenance());
}

policy::Metadata LearnerService::Provenance() const {
  return {{"config", job_.config},
          {"commit", job_.commit},
          {"seed", fmt::format("{}", job_.seed)},
          {"steps", fmt::format("{}", steps_)},
          {"updates", fmt::format("{}", updates())},
          {"training_s", fmt::format("{:.2f}", training_s())}};
}

void LearnerService::TryCheckpoint() {
  last_checkpoint_s_ = training_s();
  if (!learner_.healthy()) return;
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
  store_.Write(updates(), [&](const fs::path& directory) {
    policy::TensorMap tensors;
    learner_.SaveState(tensors);
    policy::SaveTensors(directory / kLearnerFile, tensors, {});
    const nlohmann::json state = {{"steps", steps_},
                                  {"updates", updates()},
                                  {"cursor", batches_->cursor()},
                                  {"training_s", training_s()},
                                  {"finished", finished_}};
    const nlohmann::json file = {{"state", state}, {"checksum", StateChecksum(state)}};
    base::WriteFileAtomically(directory / kStateFile, file.dump(1) + "\n");
  });
  metrics_.AddCheckpoint(std::chrono::duration<double>(steady_clock::now() - began).count(),
                         DirectoryBytes(store_.List().front()), updates());
}

void LearnerService::Restore() {
  std::vector<fs::path> damaged;
  const auto checkpoints = store_.List();
  for (const fs::path& checkpoint : checkpoints) {
    try {
      RestoreFrom(checkpoint);
      for (const fs::path& newer : damaged) store_.SetAside(newer);
      spdlog::info("resumed from {} ({} updates, {} steps, {})", checkpoint.string(), updates(),
                   base::FormatCount(static_cast<double>(steps_)),
                   base::FormatDuration(earlier_s_));
      return;
    } catch (const base::Error& error) {
      if (checkpoint == checkpoints.back()) throw;
      spdlog::error("{}; trying the checkpoint before it", error.what());
      damaged.push_back(checkpoint);
    }
  }
}

void LearnerService::RestoreFrom(const fs::path& checkpoint) {
  const fs::path path = checkpoint / kStateFile;
  nlohmann::json state;
  try {
    const auto file = nlohmann::json::parse(base::ReadFile(path));
    state = file.at("state");
    if (file.at("checksum").get<std::string>() != StateChecksum(state)) {
      throw base::Error(
          fmt::format("{}: its checksum does not match; the checkpoint is damaged", path.string()));
    }
    learner_.LoadState(policy::LoadTensors(checkpoint / kLearnerFile));
    steps_ = state.at("steps").get<std::int64_t>();
    cursor_ = state.at("cursor").get<std::uint64_t>();
    earlier_s_ = state.at("training_s").get<double>();
    finished_ = state.at("finished").get<bool>() && AtLimit();
  } catch (const nlohmann::json::exception& error) {
    throw base::Error(
        fmt::format("{}: not a checkpoint's state ({})", path.string(), error.what()));
  }
  last_checkpoint_s_ = earlier_s_;
  last_snapshot_s_ = earlier_s_;
  last_snapshot_steps_ = steps_;
}

void LearnerService::Say(const std::string& what) {
  if (what == said_) return;
  said_ = what;
  if (!what.empty()) spdlog::info("{} at {}", what, job_.replay.endpoint);
}

}  // namespace slalom::learner
