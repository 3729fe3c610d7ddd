#include "learner/service/learner_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "base/progress.h"

namespace slalom::learner {
namespace {

namespace fs = std::filesystem;

constexpr char kStateFile[] = "state.json";
constexpr char kLearnerFile[] = "learner.safetensors";

/// Of the state in `state.json`, as 16 hexadecimal digits.
std::string StateChecksum(const nlohmann::json& state) {
  return fmt::format("{:016x}", base::Checksum(std::string_view(state.dump())));
}

/// Whether one of `thresholds` lies in (last, now]; several at once give one snapshot.
template <class Number>
bool Passed(const std::vector<Number>& thresholds, double last, double now) {
  return std::ranges::any_of(thresholds, [last, now](Number at) {
    return static_cast<double>(at) > last && static_cast<double>(at) <= now;
  });
}

}  // namespace

LearnerRun::LearnerRun(RunPlan plan, const MethodConfig& method, const policy::PolicySpec& spec,
                       std::uint64_t learner_seed, run::TrainingClock clock)
    : plan_(std::move(plan)), clock_(std::move(clock)), learner_(method, spec, learner_seed) {}

double LearnerRun::Fraction() const {
  const double by_steps = static_cast<double>(steps_) / static_cast<double>(plan_.max_steps);
  const double by_time = plan_.max_seconds > 0.0 ? training_s() / plan_.max_seconds : 0.0;
  return std::clamp(std::max(by_steps, by_time), 0.0, 1.0);
}

void LearnerRun::OpenLog() {
  log_ = std::make_unique<run::MetricsLog>(plan_.directory.metrics(), steps_);
  last_row_.training_s = training_s();
  last_row_.steps = steps_;
  last_row_.updates = updates();
  MarkCheckpoint();
  logged_at_s_ = wall_s();
}

run::MetricsRow LearnerRun::Complete(run::MetricsRow row) {
  const LearnerStats learning = learner_.ReadStats();
  row.training_s = training_s();
  row.steps = steps_;
  row.updates = updates();
  const double elapsed = row.training_s - last_row_.training_s;
  if (elapsed > 0.0) {
    row.steps_per_s = static_cast<double>(row.steps - last_row_.steps) / elapsed;
    row.updates_per_s = static_cast<double>(row.updates - last_row_.updates) / elapsed;
  }
  row.critic_loss = learning.critic_loss;
  row.mean_q = learning.q_mean;
  row.actor_q = learning.actor_q_mean;
  row.critic_gradient_norm = learning.critic_gradient_norm;
  row.actor_gradient_norm = learning.actor_gradient_norm;
  row.entropy = learning.entropy;
  row.temperature = learning.temperature;
  row.cost_q = learning.cost_q_mean;
  row.multiplier = learning.multiplier;
  row.violation = learning.violation;
  row.model_loss = learning.model.loss;
  row.model_error = learning.model.held_out_rmse;
  row.model_change = learning.model.held_out_change;
  row.model_likelihood = learning.model.held_out_likelihood;
  row.model_reward_error = learning.model.held_out_reward_rmse;
  row.model_termination = learning.model.held_out_termination;
  row.model_inside_50 = learning.model.inside_50;
  row.model_inside_90 = learning.model.inside_90;
  last_row_ = row;
  logged_at_s_ = wall_s();
  if (const auto warning = watch_.Observe(row, Fraction())) spdlog::warn("{}", *warning);
  return row;
}

void LearnerRun::Append(const run::MetricsRow& row) { log_->Append(row); }

std::string LearnerRun::Progress() const {
  const double done = Fraction();
  return run::FormatProgress(last_row_, done > 0.0 ? training_s() * (1.0 / done - 1.0) : -1.0);
}

bool LearnerRun::IsWell() const {
  const auto fault = learner_.FindFault();
  if (!fault) return true;
  spdlog::error(
      "training diverged at {} steps, {} updates: {}; the last good checkpoint is kept in {}",
      steps_, updates(), *fault, plan_.directory.checkpoints().string());
  return false;
}

void LearnerRun::KeepSnapshots() {
  const double now = training_s();
  const bool due = Passed(plan_.snapshot_seconds, last_snapshot_s_, now) ||
                   Passed(plan_.snapshot_steps, static_cast<double>(last_snapshot_steps_),
                          static_cast<double>(steps_));
  last_snapshot_s_ = now;
  last_snapshot_steps_ = steps_;
  if (!due) return;
  try {
    base::MakeDirectories(plan_.directory.snapshots());
    policy::SavePolicy(plan_.directory.snapshot(steps_), learner_.BestSnapshot(), Provenance());
  } catch (const base::Error& error) {
    spdlog::error("snapshot not kept: {}; training goes on", error.what());
  }
}

void LearnerRun::SavePolicy() const {
  policy::SavePolicy(plan_.directory.policy(), learner_.BestSnapshot(), Provenance());
}

nn::Metadata LearnerRun::Provenance() const {
  return {{"config", plan_.config},
          {"commit", plan_.commit},
          {"seed", fmt::format("{}", plan_.seed)},
          {"steps", fmt::format("{}", steps_)},
          {"updates", fmt::format("{}", updates())},
          {"training_s", fmt::format("{:.2f}", training_s())}};
}

void LearnerRun::Checkpoint(std::int64_t number, nlohmann::json state,
                            const std::function<void(const fs::path&)>& write_more) {
  store_->Write(number, [&](const fs::path& directory) {
    nn::TensorMap tensors;
    learner_.SaveState(tensors);
    nn::SaveTensors(directory / kLearnerFile, tensors, {});
    write_more(directory);
    state["steps"] = steps_;
    state["training_s"] = training_s();
    const nlohmann::json file = {{"state", state}, {"checksum", StateChecksum(state)}};
    base::WriteFileAtomically(directory / kStateFile, file.dump(1) + "\n");
  });
}

bool LearnerRun::Restore(
    const std::function<void(const fs::path&, const nlohmann::json&)>& read_more) {
  std::vector<fs::path> damaged;
  const auto checkpoints = store_->List();
  for (const fs::path& checkpoint : checkpoints) {
    try {
      RestoreFrom(checkpoint, read_more);
      for (const fs::path& newer : damaged) store_->SetAside(newer);
      spdlog::info("resumed from {} ({} steps, {} updates, {})", checkpoint.string(),
                   base::FormatCount(static_cast<double>(steps_)), updates(),
                   base::FormatDuration(training_s()));
      return true;
    } catch (const base::Error& error) {
      if (checkpoint == checkpoints.back()) throw;
      spdlog::error("{}; trying the checkpoint before it", error.what());
      damaged.push_back(checkpoint);
    }
  }
  return false;
}

void LearnerRun::RestoreFrom(
    const fs::path& checkpoint,
    const std::function<void(const fs::path&, const nlohmann::json&)>& read_more) {
  const fs::path path = checkpoint / kStateFile;
  try {
    const auto file = nlohmann::json::parse(base::ReadFile(path));
    const auto& state = file.at("state");
    if (file.at("checksum").get<std::string>() != StateChecksum(state)) {
      throw base::Error(
          fmt::format("{}: its checksum does not match; the checkpoint is damaged", path.string()));
    }
    const auto steps = state.at("steps").get<std::int64_t>();
    const auto training_s = state.at("training_s").get<double>();
    const auto tensors = nn::LoadTensors(checkpoint / kLearnerFile);
    read_more(checkpoint, state);
    learner_.LoadState(tensors);
    steps_ = steps;
    clock_.Restore(training_s);
  } catch (const nlohmann::json::exception&) {
    throw base::Error(fmt::format("{}: damaged, or no state of a checkpoint", path.string()));
  }
  last_snapshot_s_ = training_s();
  last_snapshot_steps_ = steps_;
}

}  // namespace slalom::learner
