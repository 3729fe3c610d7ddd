#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "learner/learner.h"
#include "learner/loop/batch_source.h"
#include "learner/loop/policy_sink.h"
#include "learner/run/metrics_log.h"
#include "learner/run/training_run.h"
#include "metrics/registry.h"

namespace slalom::learner {

/// Settings of a loop besides the settings of learning.
struct LoopPlan {
  run::RunPlan run;
  double publish_seconds = 0.0;  ///< Shortest time between two published policies, [s].
  /// Whether checkpoints are numbered by updates, not by steps. The numbers must rise.
  bool numbers_by_updates = false;
  /// Whether a run that has reached run.max_steps goes on until it has made the updates that these
  /// steps earn (`BatchSource::num_drawn`). Otherwise it ends at once.
  bool makes_all_updates = false;
  /// Whether the process keeps running after the last step. If so, a failed final save is logged
  /// and not fatal.
  bool lives_on = false;
};

/// How a training ended.
enum class TrainingEnd {
  kFinished,  ///< At its limit of steps or seconds.
  kStopped,   ///< On request; saved.
  kDiverged,  ///< At NaN or values beyond bounds; the last good checkpoint is kept, nothing newer
              ///< saved.
  kUnsaved,   ///< At its limit or on request. The policy is kept, but the last checkpoint could not
              ///< be written.
  kLearnedNothing,  ///< At its limit, without an update or with a dead network
                    ///< (`run::LearningWatch`). A checkpoint is saved, but no policy.
  kWasFinished,  ///< A resumed run that was at its limit already. The policy is written if a crash
                 ///< at the end of the run has left it out; nothing else happens.
};

/// The metrics of a process that learns. Confined to one thread.
class LearnerMetrics {
 public:
  explicit LearnerMetrics(metrics::Registry& registry);

  void AddUpdate(double seconds);
  /// Sets the learner's own columns of a row.
  void SetLearning(const run::MetricsRow& row);
  void AddCheckpoint(double seconds, std::int64_t bytes, std::int64_t updates);
  void AddFailedCheckpoint();
  void SetFinished(bool finished);

 private:
  metrics::Registry& registry_;
  metrics::Counter updates_;
  metrics::Histogram update_seconds_;
};

/// Trains a learner from a source of batches to the end of its run: updates, publishes policies,
/// logs, keeps snapshots and checkpoints. One process and the service both train by this loop.
/// Confined to the thread that made it.
class LearnerLoop {
 public:
  /// Opens the run's checkpoints. Keeps references to `learner`, `source`, `sink` and `registry`,
  /// which must outlive the loop. Throws as `run::TrainingRun` does.
  LearnerLoop(LoopPlan plan, Learner& learner, BatchSource& source, PolicySink& sink,
              metrics::Registry& registry, run::TrainingClock clock);

  /// Continues from the newest intact checkpoint (`run::TrainingRun::Restore`). Returns false if
  /// there is none.
  bool Restore();

  /// Trains to the end of the run, or until `stop`. Writes metrics.csv, checkpoints, snapshots and
  /// policy.safetensors. The policy is written before the last checkpoint. Throws `base::Error` if
  /// the policy cannot be written, or the source fails.
  TrainingEnd Run(std::stop_token stop);

  /// Shows the figures of a finished run again if the next row is due.
  void ReportIfDue();
  /// Publishes the learner's policy now.
  void Publish();

  const run::TrainingRun& run() const { return run_; }
  /// Removes all but the newest `num_kept` checkpoints, and the data that only the removed ones
  /// needed. If no checkpoint is left, the source keeps its data. Files that cannot be removed
  /// stay, with a warning.
  void KeepCheckpoints(std::size_t num_kept);

 private:
  bool AtEnd() const;
  TrainingEnd Train(std::stop_token stop);
  TrainingEnd EndAgain();
  void Turn();
  void Learn(const std::vector<replay::SampledRows>& batches);
  void CountTime();
  /// Writes and shows a row of metrics. Returns false if the learner has diverged.
  [[nodiscard]] bool Log();
  [[nodiscard]] bool IsWell() const;
  void KeepSnapshot();
  void TryCheckpoint();
  void Checkpoint();
  /// Writes the last checkpoint. Returns false if it could not be written and the process does not
  /// keep running after the last step; it then logs the reason and `what_is_kept`.
  bool LastCheckpoint(const std::string& what_is_kept);
  bool HasLearnedNothing() const;
  bool HasNewestPolicy() const;
  void SavePolicy() const;

  const LoopPlan plan_;
  Learner& learner_;
  BatchSource& source_;
  PolicySink& sink_;
  const bool prioritized_;
  run::TrainingRun run_;
  LearnerMetrics metrics_;

  int unpublished_ = 0;  // Updates since the last published policy.
  int unobserved_ = 0;   // Updates since the last look at the episodes that ended.
  std::optional<std::chrono::steady_clock::time_point> published_at_;
  std::optional<double> waiting_since_s_;              // On the run's wall clock.
  double model_steps_error_ = run::MetricsRow::kNone;  // The newest.
  bool had_learned_nothing_ = false;  // At the checkpoint that the run continues from.
  bool finished_ = false;
};

}  // namespace slalom::learner
