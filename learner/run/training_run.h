#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "learner/run/checkpoint_store.h"
#include "learner/run/learning_watch.h"
#include "learner/run/metrics_log.h"
#include "learner/run/run_directory.h"
#include "learner/run/run_settings.h"
#include "learner/run/training_clock.h"

namespace slalom::run {

/// What a run is to do, and where.
struct RunPlan {
  RunDirectory directory;
  RunSettings settings;
  std::string config;  ///< The run's, as TOML: goes with every policy that is kept.
  std::string commit;  ///< Of the program.
};

/// A run on its way: its clock and limits, metrics.csv, checkpoints, and when copies of the policy
/// are due. It knows nothing of what is trained: functions that the caller gives write and read
/// that. Confined to one thread.
class TrainingRun {
 public:
  /// Writes files into the directory of a checkpoint and adds to its state, an object.
  using Write = std::function<void(const std::filesystem::path&, nlohmann::json&)>;
  /// Reads both again. Returns the number of updates that were made.
  using Read = std::function<std::int64_t(const std::filesystem::path&, const nlohmann::json&)>;

  /// Opens the checkpoints. Training time does not count before `StartClock`. Throws `base::Error`
  /// if the directory cannot be written. Requires: the directory is this process's (`RunLock`).
  TrainingRun(RunPlan plan, TrainingClock clock);

  const RunPlan& plan() const { return plan_; }

  /// Environment steps and updates that the run has made, as far as is known here.
  std::int64_t steps() const { return steps_; }
  std::int64_t updates() const { return updates_; }
  void SetProgress(std::int64_t steps, std::int64_t updates) {
    steps_ = steps;
    updates_ = updates;
  }

  /// Training time counts from here on. Call it when the next thing to happen is training, and
  /// `StopClock` when training has to wait for another process.
  void StartClock() { clock_.Start(); }
  void StopClock() { clock_.Stop(); }
  /// Takes the time, for all that asks for it until the next look. Once in each turn of the loop.
  void LookAtClock() { clock_.Look(); }

  /// Time spent training, over all sessions of the run, as of the last look at the clock, [s].
  double training_s() const { return clock_.training_s(); }
  /// A clock that goes forward whether the run trains or waits, as of the last look, [s].
  double wall_s() const { return clock_.wall_s(); }
  double Fraction() const;  ///< Part of the run that is done, in [0, 1].
  bool AtLimit() const { return Fraction() >= 1.0; }

  /// Opens metrics.csv where the run goes on from. Once, after `Restore`.
  void OpenLog();
  bool LogDue() const {
    return !logged_at_s_ || wall_s() - *logged_at_s_ >= plan_.settings.log_interval;
  }
  /// Adds the run's own figures to `row` and appends it to metrics.csv, unless the log is not open
  /// or nothing has happened since the last row. Returns the row. Warns if the rows show that
  /// learning is dead (`LearningWatch`).
  MetricsRow Log(MetricsRow row);
  /// The last row and the time left, as a progress line.
  std::string Progress() const;
  /// What the rows say of whether the run learns.
  const LearningWatch& watch() const { return watch_; }

  /// Whether the plan's next time or number of steps for a snapshot has passed since the last call.
  /// If so, the caller writes it to `RunDirectory::snapshot`.
  [[nodiscard]] bool TakeSnapshotDue();
  /// What is kept with every policy: config, commit, seed, steps, updates and training time.
  std::map<std::string, std::string> Provenance() const;

  /// Whether a checkpoint is due, by steps or, unless the run is deterministic, by the wall clock:
  /// so what was learned before an outage is saved while it lasts.
  bool CheckpointDue() const;
  /// A checkpoint was tried now, with or without success.
  void MarkCheckpoint();
  /// Writes the checkpoint `step-NUMBER`, the run's own state and what `write` writes, and returns
  /// its directory. Throws `base::Error` if that fails.
  std::filesystem::path Checkpoint(std::int64_t number, const Write& write);

  /// Goes on from the newest checkpoint that is whole; `read` throws `base::Error` if what it reads
  /// is damaged. Damaged ones that are newer are set aside. Returns false if there is none. Throws
  /// `base::Error` if all are damaged.
  bool Restore(const Read& read);

  /// Removes all but the newest `num_kept` checkpoints (`CheckpointStore::Keep`).
  std::vector<std::filesystem::path> KeepCheckpoints(std::size_t num_kept) {
    return store_.Keep(num_kept);
  }

 private:
  void RestoreFrom(const std::filesystem::path& checkpoint, const Read& read);

  const RunPlan plan_;
  TrainingClock clock_;
  CheckpointStore store_;
  std::unique_ptr<MetricsLog> log_;

  std::int64_t steps_ = 0;
  std::int64_t updates_ = 0;
  double last_snapshot_s_ = 0.0;
  std::int64_t last_snapshot_steps_ = 0;
  MetricsRow last_row_;
  std::optional<double> logged_at_s_;  // By `wall_s`.
  double checkpoint_at_s_ = 0.0;       // By `wall_s`; set by `OpenLog`.
  std::int64_t checkpoint_at_steps_ = 0;
  LearningWatch watch_;
};

}  // namespace slalom::run
