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
#include "learner/run/fence.h"
#include "learner/run/learning_watch.h"
#include "learner/run/metrics_log.h"
#include "learner/run/run_directory.h"
#include "learner/run/run_settings.h"
#include "learner/run/training_clock.h"

namespace slalom::run {

/// The settings of a run and its place.
struct RunPlan {
  RunDirectory directory;
  RunSettings settings;
  std::string config;     ///< The run's config as TOML, stored with every policy.
  std::string commit;     ///< Commit of the program.
  Fence fence{};          ///< Without it nothing is written.
  bool has_goals = true;  ///< Whether an episode may succeed.
};

/// A running training: its clock and limits, metrics.csv, checkpoints, and the times of snapshots.
/// It does not know the learner: functions of the caller write and read its state. Confined to one
/// thread.
class TrainingRun {
 public:
  /// Writes files into the directory of a checkpoint and adds to its state, an object.
  using Write = std::function<void(const std::filesystem::path&, nlohmann::json&)>;
  /// Reads both back. Returns the number of updates done.
  using Read = std::function<std::int64_t(const std::filesystem::path&, const nlohmann::json&)>;

  /// Opens the checkpoints. Training time does not count before `StartClock`. Throws `base::Error`
  /// if the directory cannot be written. Requires: this process holds the directory's `RunLock`.
  TrainingRun(RunPlan plan, TrainingClock clock);

  const RunPlan& plan() const { return plan_; }

  /// Environment steps and updates of the run, as of the last `SetProgress` or `Restore`.
  std::int64_t steps() const { return steps_; }
  std::int64_t updates() const { return updates_; }
  void SetProgress(std::int64_t steps, std::int64_t updates) {
    steps_ = steps;
    updates_ = updates;
  }

  /// Starts to count training time. Call it just before training, and `StopClock` when training has
  /// to wait for another process.
  void StartClock() { clock_.Start(); }
  void StopClock() { clock_.Stop(); }
  /// Reads the clock; the time stays the same until the next look. Call it once in each turn of the
  /// loop.
  void LookAtClock() { clock_.Look(); }

  /// Time spent training, over all sessions of the run, as of the last look at the clock, [s].
  double training_s() const { return clock_.training_s(); }
  /// A clock that goes forward whether the run trains or waits, as of the last look, [s].
  double wall_s() const { return clock_.wall_s(); }
  double Fraction() const;  ///< Part of the run that is done, in [0, 1].
  bool AtLimit() const { return Fraction() >= 1.0; }

  /// Opens metrics.csv at the row from which the run continues. Call it once, after `Restore`.
  void OpenLog();
  bool LogDue() const {
    return !logged_at_s_ || wall_s() - *logged_at_s_ >= plan_.settings.log_interval;
  }
  /// Adds the run's own figures to `row` and appends it to metrics.csv, unless the log is not open
  /// or nothing has happened since the last row. Returns the row. Warns if the rows show that
  /// learning is dead (`LearningWatch`).
  MetricsRow Log(MetricsRow row);
  /// Time left at the pace so far, [s]; NaN before the run has made any progress.
  double SecondsLeft() const;
  /// The last row and the time left, as a progress line.
  std::string Progress() const;
  /// The watch over the rows, which knows whether the run learns.
  const LearningWatch& watch() const { return watch_; }

  /// Whether the plan's next time or number of steps for a snapshot has passed since the last call.
  /// If so, the caller writes it to `RunDirectory::snapshot`.
  [[nodiscard]] bool TakeSnapshotDue();
  /// The metadata of every policy: config, commit, seed, steps, updates and training time.
  std::map<std::string, std::string> Provenance() const;

  /// Whether a checkpoint is due, by steps or, unless the run is deterministic, by the wall clock.
  /// So the learner saves its progress even during an outage.
  bool CheckpointDue() const;
  /// Notes that a checkpoint was tried now, with or without success.
  void MarkCheckpoint();
  /// Writes the checkpoint `step-NUMBER`, which holds the run's own state and the files of `write`.
  /// Returns its directory. Throws `base::Error` if that fails.
  std::filesystem::path Checkpoint(std::int64_t number, const Write& write);

  /// Continues from the newest intact checkpoint. `read` throws `base::Error` if its data is
  /// damaged. Damaged checkpoints that are newer are set aside. Returns false if there is no
  /// checkpoint. Throws `base::Error` if all are damaged.
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
  std::optional<double> logged_at_s_;  // On the clock of `wall_s`.
  double checkpoint_at_s_ = 0.0;       // On the same clock; set by `OpenLog`.
  std::int64_t checkpoint_at_steps_ = 0;
  LearningWatch watch_;
};

}  // namespace slalom::run
