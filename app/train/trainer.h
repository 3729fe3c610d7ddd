#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "actor/actor.h"
#include "app/train/resolved_run.h"
#include "app/train/table_source.h"
#include "base/parallel.h"
#include "learner/learner.h"
#include "learner/loop/learner_loop.h"
#include "learner/run/run_directory.h"
#include "metrics/registry.h"
#include "policy/policy_agent.h"
#include "replay/table.h"
#include "sim/environments.h"

namespace slalom::train {

using learner::TrainingEnd;

/// One training run in one process: a `learner::LearnerLoop` between a table and the actor that
/// fills it.
///
/// Confined to the thread that made it (it starts others inside). A deterministic run is a function
/// of its config: it gives the same policy, bit for bit, even if it is killed and resumed any
/// number of times.
class Trainer {
 public:
  /// Builds everything, then begins the run's directory (`BeginTraining`). With `resume`, checks
  /// the directory instead and continues from the newest intact checkpoint. `commit`: the
  /// program's commit, for provenance. `registry`, which must outlive the trainer, shows the
  /// metrics of a learner. `clock` measures training time, which counts from `Run` on; tests give
  /// their own. `held`: the run's lock, if the caller has begun or checked the directory already.
  /// Throws `base::Error` if courses or checkpoint are unusable, if the disk has no room
  /// (`RequireRoom`), or if another process trains there.
  Trainer(const ResolvedRun& config, const run::RunDirectory& directory, std::string commit,
          bool resume, metrics::Registry& registry, run::TrainingClock clock = run::TrainingClock(),
          std::optional<run::RunLock> held = std::nullopt);
  ~Trainer();

  /// Trains to the end of the run, or until `stop` (`learner::LearnerLoop::Run`). Keeps the
  /// checkpoints of a finished run that `run.keep_checkpoints` names. Throws `base::Error` if the
  /// policy cannot be written.
  TrainingEnd Run(std::stop_token stop);

  /// Time spent training, over all sessions of the run, [s].
  double training_s() const { return loop_.run().training_s(); }
  std::int64_t steps() const { return loop_.run().steps(); }
  std::int64_t updates() const { return loop_.run().updates(); }
  /// The watch over this session's metrics, which knows whether the run learns.
  const run::LearningWatch& watch() const { return loop_.run().watch(); }

 private:
  const ResolvedRun config_;
  base::ParallelFor parallel_;
  sim::CourseEnvironments environments_;
  learner::Learner learner_;
  std::unique_ptr<policy::PolicyAgent> agent_;
  const std::unique_ptr<actor::Teachers> teachers_;  // May be null.
  actor::Actor actor_;
  replay::Table table_;
  // The disk is not touched before everything that a bad config can break has been built.
  const run::RunLock lock_;
  TableSource source_;
  learner::LearnerLoop loop_;
};

}  // namespace slalom::train
