#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "learner/learner.h"
#include "policy/policy.h"
#include "run/checkpoint_store.h"
#include "run/learning_watch.h"
#include "run/metrics_log.h"
#include "run/run_directory.h"
#include "run/training_clock.h"

namespace slalom::learner {

/// How long a run learns and what it keeps.
struct RunPlan {
  run::RunDirectory directory;
  std::string config;  ///< The run's, as TOML: goes with every policy that is kept.
  std::string commit;  ///< Of the program.
  std::int64_t seed = 0;
  std::int64_t max_steps = 0;
  double max_seconds = 0.0;              ///< 0: no limit.
  double log_interval = 1.0;             ///< [s]
  std::vector<double> snapshot_seconds;  ///< As in the run's config.
  std::vector<int> snapshot_steps;
};

/// A learner on its way through a run: its clock and limits, metrics.csv, snapshots, the policy to
/// ship and checkpoints, whether its transitions come from this process or from a replay server.
/// Confined to one thread.
class LearnerRun {
 public:
  /// Builds the learner; touches nothing on disk. Throws `base::Error` where the config cannot be
  /// met. Training time does not count before `StartClock`.
  LearnerRun(RunPlan plan, const MethodConfig& method, const policy::PolicySpec& spec,
             std::uint64_t learner_seed, run::TrainingClock clock);

  /// Opens the checkpoints. Once, when the directory is this process's. Throws `base::Error` where
  /// it cannot be written.
  void Open() { store_.emplace(plan_.directory.checkpoints()); }

  Learner& learner() { return learner_; }
  const Learner& learner() const { return learner_; }
  std::int64_t updates() const { return learner_.num_updates(); }

  /// Environment steps that the run has made, as far as is known here.
  std::int64_t steps() const { return steps_; }
  void SetSteps(std::int64_t steps) { steps_ = steps; }

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
  bool LogDue() const { return wall_s() - logged_at_s_ >= plan_.log_interval; }
  /// Adds the run's and the learner's figures to `row`, which holds those of actors and replay.
  /// Warns where they show that learning is dead (`run::LearningWatch`).
  run::MetricsRow Complete(run::MetricsRow row);
  /// Appends a row to metrics.csv.
  void Append(const run::MetricsRow& row);
  /// The last row that was completed, and time left, as a progress line.
  std::string Progress() const;
  /// What the rows of this session say of whether the run learns.
  const run::LearningWatch& watch() const { return watch_; }

  /// False: the learner diverged, which is then said.
  [[nodiscard]] bool IsWell() const;

  /// Keeps a snapshot where the plan's next time or number of steps has passed. One that cannot be
  /// written is said and left out.
  void KeepSnapshots();
  /// Writes policy.safetensors.
  void SavePolicy() const;

  /// Writes the checkpoint `step-NUMBER`: the learner, `state` (an object) and what `write_more`
  /// writes into its directory. Throws `base::Error` where that fails.
  void Checkpoint(std::int64_t number, nlohmann::json state,
                  const std::function<void(const std::filesystem::path&)>& write_more);

  /// Goes on from the newest checkpoint that is whole; `read_more` reads what else it holds and
  /// throws `base::Error` where that is damaged. Damaged ones that are newer are set aside. False:
  /// there is none. Throws `base::Error` where all are damaged.
  bool Restore(
      const std::function<void(const std::filesystem::path&, const nlohmann::json&)>& read_more);

  const run::CheckpointStore& store() const { return *store_; }
  /// Removes all but the newest `num_kept` checkpoints.
  void KeepCheckpoints(std::size_t num_kept) { store_->Keep(num_kept); }
  /// Time since a checkpoint was last tried or the log was opened, by the wall clock, [s]: what was
  /// learned before an outage is saved while it lasts.
  double since_checkpoint_s() const { return wall_s() - checkpoint_at_s_; }
  /// A checkpoint was tried now, with or without success.
  void MarkCheckpoint() {
    LookAtClock();
    checkpoint_at_s_ = wall_s();
  }

 private:
  void RestoreFrom(
      const std::filesystem::path& checkpoint,
      const std::function<void(const std::filesystem::path&, const nlohmann::json&)>& read_more);
  nn::Metadata Provenance() const;

  const RunPlan plan_;
  run::TrainingClock clock_;
  Learner learner_;
  std::optional<run::CheckpointStore> store_;
  std::unique_ptr<run::MetricsLog> log_;

  std::int64_t steps_ = 0;
  double last_snapshot_s_ = 0.0;
  std::int64_t last_snapshot_steps_ = 0;
  run::MetricsRow last_row_;
  double logged_at_s_ = 0.0;      // By `wall_s`.
  double checkpoint_at_s_ = 0.0;  // By `wall_s`.
  run::LearningWatch watch_;
};

}  // namespace slalom::learner
