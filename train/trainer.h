#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <stop_token>
#include <string>
#include <vector>

#include "actor/actor.h"
#include "base/parallel.h"
#include "learner/service/learner_run.h"
#include "policy/policy.h"
#include "policy/policy_agent.h"
#include "replay/storage.h"
#include "replay/table.h"
#include "run/run_directory.h"
#include "sim/environments.h"
#include "train/collector.h"
#include "train/run_config.h"
#include "train/update_budget.h"

namespace slalom::train {

/// How a training ended.
enum class TrainingEnd {
  kFinished,  ///< At its limit of steps or seconds.
  kStopped,   ///< On request; saved.
  kDiverged,  ///< At NaN or values beyond bounds; the last good checkpoint is kept, nothing newer
              ///< saved.
  kLearnedNothing,  ///< At its limit, without an update or with a dead network
                    ///< (`run::LearningWatch`). A checkpoint is saved, but no policy.
  kWasFinished,     ///< A resumed run that stood at its limit already. What a crash at its end may
                    ///< have left undone was done (policy, checkpoints), nothing else.
};

/// One training run in one process: actor, replay table and learner, with checkpoints and figures.
///
/// Confined to the thread that made it (it starts others inside). A deterministic run is a value of
/// its config: the same policy, bit for bit, however often it was killed and resumed.
class Trainer {
 public:
  /// Builds everything, then begins the run's directory (`BeginRun`), or where `resume` checks it
  /// (`ResumeRun`) and continues from its newest checkpoint that is whole. `commit`: of the
  /// program, for provenance. `clock`: measures training time, which counts from `Run` on; tests
  /// give their own. Throws `base::Error` where courses, config or checkpoint are unusable, a new
  /// run could not learn anything (`RequireLearnable`), or another process trains there.
  Trainer(const RunConfig& config, const run::RunDirectory& directory, std::string commit,
          bool resume, run::TrainingClock clock = run::TrainingClock());
  ~Trainer();

  /// Trains to the end of the run, or until `stop`. Writes metrics.csv, checkpoints, snapshots and
  /// policy.safetensors; of a finished run's checkpoints keeps what `run.keep_checkpoints` says.
  /// Throws `base::Error` where what must be kept cannot be written.
  TrainingEnd Run(std::stop_token stop);

  /// Time spent training, over all sessions of the run, [s].
  double training_s() const { return run_.training_s(); }
  std::int64_t steps() const { return budget_.steps(); }
  std::int64_t updates() const { return run_.updates(); }
  /// What this session's metrics say of whether the run learns.
  const run::LearningWatch& watch() const { return run_.watch(); }

 private:
  void StartCollector();
  void StopCollector();
  void Collect();
  void InsertChunk(std::unique_ptr<replay::Chunk> chunk);
  void Update();
  TrainingEnd Train(std::stop_token stop);
  /// Writes a row of metrics. False: the learner diverged.
  [[nodiscard]] bool Log();
  bool CheckpointDue() const;
  void TryCheckpoint();
  void Checkpoint();
  /// Deletes the replay's part files that no checkpoint needs.
  void CommitReplay();
  /// Whether policy.safetensors is that of the updates made so far.
  bool HasNewestPolicy() const;
  void PruneCheckpoints();
  void Restore();
  void ReadCheckpoint(const std::filesystem::path& checkpoint, const nlohmann::json& state);

  const RunConfig config_;
  const run::RunDirectory directory_;

  base::ParallelFor parallel_;
  sim::CourseEnvironments environments_;
  learner::LearnerRun run_;
  std::unique_ptr<policy::PolicyAgent> agent_;
  actor::Actor actor_;
  replay::Table table_;
  std::vector<replay::SampledRows> rows_;  // One of each kind that an update learns from.
  base::Random sampling_;
  std::int64_t observed_episodes_ = 0;  // That the learner was told of.
  base::Random diagnostics_;            // Of windows that figures alone are made from.
  replay::SampledRows windows_;
  UpdateBudget budget_;
  // Nothing on disk is touched before all that a bad config can break has been built.
  const run::RunLock lock_;
  replay::Storage storage_;
  std::unique_ptr<Collector> collector_;

  std::int64_t last_checkpoint_steps_ = 0;
  bool had_learned_nothing_ = false;  // As of the checkpoint that the run goes on from.
};

}  // namespace slalom::train
