#include "learner/run/training_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "base/json.h"
#include "base/log.h"
#include "base/progress.h"
#include "learner/run/run_directory.h"

namespace slalom::run {
namespace {

namespace fs = std::filesystem;

/// Checksum of the state in `state.json`, as 16 hexadecimal digits.
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

TrainingRun::TrainingRun(RunPlan plan, TrainingClock clock)
    : plan_(std::move(plan)),
      clock_(std::move(clock)),
      store_(plan_.directory.checkpoints()),
      watch_(plan_.has_goals) {}

double TrainingRun::Fraction() const {
  const double by_steps =
      static_cast<double>(steps_) / static_cast<double>(plan_.settings.max_steps);
  const double by_time =
      plan_.settings.max_seconds > 0.0 ? training_s() / plan_.settings.max_seconds : 0.0;
  return std::clamp(std::max(by_steps, by_time), 0.0, 1.0);
}

void TrainingRun::OpenLog() {
  log_ = std::make_unique<MetricsLog>(plan_.directory.metrics(), steps_);
  MarkCheckpoint();
  logged_at_s_ = wall_s();
}

MetricsRow TrainingRun::Log(MetricsRow row) {
  row.training_s = training_s();
  row.steps = steps_;
  row.updates = updates_;
  const double elapsed = row.training_s - last_row_.training_s;
  if (elapsed > 0.0) {
    row.steps_per_s = static_cast<double>(row.steps - last_row_.steps) / elapsed;
    row.updates_per_s = static_cast<double>(row.updates - last_row_.updates) / elapsed;
  }
  const bool is_news =
      elapsed > 0.0 || row.steps != last_row_.steps || row.updates != last_row_.updates;
  last_row_ = row;
  logged_at_s_ = wall_s();
  if (const auto warning = watch_.Observe(row, Fraction())) spdlog::warn("{}", *warning);
  if (is_news && log_) log_->Append(row);
  return row;
}

double TrainingRun::SecondsLeft() const {
  const double done = Fraction();
  return done > 0.0 ? training_s() * (1.0 / done - 1.0) : std::numeric_limits<double>::quiet_NaN();
}

std::string TrainingRun::Progress() const { return FormatProgress(last_row_, SecondsLeft()); }

bool TrainingRun::TakeSnapshotDue() {
  const double now = training_s();
  const bool due = Passed(plan_.settings.snapshot_seconds, last_snapshot_s_, now) ||
                   Passed(plan_.settings.snapshot_steps, static_cast<double>(last_snapshot_steps_),
                          static_cast<double>(steps_));
  last_snapshot_s_ = now;
  last_snapshot_steps_ = steps_;
  return due;
}

std::map<std::string, std::string> TrainingRun::Provenance() const {
  return {{"config", plan_.config},
          {"commit", plan_.commit},
          {"seed", fmt::format("{}", plan_.settings.seed)},
          {"steps", fmt::format("{}", steps_)},
          {"updates", fmt::format("{}", updates_)},
          {"training_s", fmt::format("{:.2f}", training_s())}};
}

bool TrainingRun::CheckpointDue() const {
  const RunSettings& settings = plan_.settings;
  const std::int64_t every = settings.checkpoint_steps;
  if (every > 0 && steps_ / every != checkpoint_at_steps_ / every) return true;
  return settings.checkpoint_seconds > 0.0 && !settings.deterministic &&
         wall_s() - checkpoint_at_s_ >= settings.checkpoint_seconds;
}

void TrainingRun::MarkCheckpoint() {
  LookAtClock();
  checkpoint_at_s_ = wall_s();
  checkpoint_at_steps_ = steps_;
}

fs::path TrainingRun::Checkpoint(std::int64_t number, const Write& write) {
  return store_.Write(number, [&](const fs::path& directory) {
    nlohmann::json state = nlohmann::json::object();
    write(directory, state);
    state["steps"] = steps_;
    state["training_s"] = training_s();
    state["snapshot_s"] = last_snapshot_s_;
    state["snapshot_steps"] = last_snapshot_steps_;
    state["learning_watch"] = watch_.state();
    const nlohmann::json file = {{"state", state}, {"checksum", StateChecksum(state)}};
    base::WriteFileAtomically(CheckpointFiles{directory}.state(), file.dump(1) + "\n");
  });
}

bool TrainingRun::Restore(const Read& read) {
  std::vector<fs::path> damaged;
  const auto checkpoints = store_.List();
  for (const fs::path& checkpoint : checkpoints) {
    try {
      RestoreFrom(checkpoint, read);
      for (const fs::path& newer : damaged) store_.SetAside(newer);
      spdlog::info("resumed from {} ({} steps, {} updates, {})", checkpoint.string(),
                   base::FormatCount(static_cast<double>(steps_)), updates_,
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

void TrainingRun::RestoreFrom(const fs::path& checkpoint, const Read& read) {
  const fs::path path = CheckpointFiles{checkpoint}.state();
  try {
    const auto file = base::ParseJson(base::ReadFile(path));
    const auto& state = file.at("state");
    base::ThrowIf(file.at("checksum").get<std::string>() != StateChecksum(state),
                  "{}: its checksum does not match; the checkpoint is damaged", path.string());
    const auto steps = base::WholeNumber(state.at("steps"));
    const auto training_s = state.at("training_s").get<double>();
    const auto snapshot_s = state.at("snapshot_s").get<double>();
    const auto snapshot_steps = base::WholeNumber(state.at("snapshot_steps"));
    const auto watch = state.at("learning_watch").get<LearningWatch::State>();
    const std::int64_t updates = read(checkpoint, state);
    SetProgress(steps, updates);
    clock_.Restore(training_s);
    last_snapshot_s_ = snapshot_s;
    last_snapshot_steps_ = snapshot_steps;
    watch_ = LearningWatch(plan_.has_goals, watch);
  } catch (const nlohmann::json::exception&) {
    throw base::Error("{}: damaged, or no state of a checkpoint", path.string());
  }
  last_row_.training_s = training_s();
  last_row_.steps = steps_;
  last_row_.updates = updates_;
}

}  // namespace slalom::run
