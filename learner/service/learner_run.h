#pragma once

#include <chrono>
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
#include "run/metrics_log.h"
#include "run/run_directory.h"

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
  /// Builds the learner; touches nothing on disk. `begin`: when the process began, as training time
  /// counts from there. Throws `base::Error` where the config cannot be met.
  LearnerRun(RunPlan plan, const MethodConfig& method, const policy::PolicySpec& spec,
             std::uint64_t learner_seed, std::chrono::steady_clock::time_point begin);

  /// Opens the checkpoints. Once, when the directory is this process's. Throws `base::Error` where
  /// it cannot be written.
  void Open() { store_.emplace(plan_.directory.checkpoints()); }

  Learner& learner() { return learner_; }
  const Learner& learner() const { return learner_; }
  std::int64_t updates() const { return learner_.num_updates(); }

  /// Environment steps that the run has made, as far as is known here.
  std::int64_t steps() const { return steps_; }
  void SetSteps(std::int64_t steps) { steps_ = steps; }

  /// Wall-clock spent on the run, over all its sessions, [s].
  double training_s() const;
  double Fraction() const;  ///< Part of the run that is done, in [0, 1].
  bool AtLimit() const { return Fraction() >= 1.0; }

  /// Opens metrics.csv where the run goes on from. Once, after `Restore`.
  void OpenLog();
  bool LogDue() const { return training_s() - last_row_.training_s >= plan_.log_interval; }
  /// Adds the run's and the learner's figures to `row`, which holds those of actors and replay.
  run::MetricsRow Complete(run::MetricsRow row);
  /// Appends a row to metrics.csv.
  void Append(const run::MetricsRow& row);
  /// The last row that was completed, and time left, as a progress line.
  std::string Progress() const;

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
  double last_checkpoint_s() const { return last_checkpoint_s_; }
  /// A checkpoint was tried now, with or without success.
  void MarkCheckpoint() { last_checkpoint_s_ = training_s(); }

 private:
  void RestoreFrom(
      const std::filesystem::path& checkpoint,
      const std::function<void(const std::filesystem::path&, const nlohmann::json&)>& read_more);
  policy::Metadata Provenance() const;

  const RunPlan plan_;
  const std::chrono::steady_clock::time_point begin_;
  Learner learner_;
  std::optional<run::CheckpointStore> store_;
  std::unique_ptr<run::MetricsLog> log_;

  double earlier_s_ = 0.0;  // Training time of earlier sessions, [s].
  std::int64_t steps_ = 0;
  double last_checkpoint_s_ = 0.0;
  double last_snapshot_s_ = 0.0;
  std::int64_t last_snapshot_steps_ = 0;
  run::MetricsRow last_row_;
};

}  // namespace slalom::learner
