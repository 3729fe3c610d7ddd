#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/config_field.h"

namespace slalom::run {

/// The checkpoints that a finished run keeps.
enum class KeepCheckpoints { kNewest, kAll, kNone };
inline base::OneOf EnumNames(KeepCheckpoints) { return {"newest", "all", "none"}; }

/// How long a run is, what it keeps, and how simulation and learning share the time.
struct RunSettings {
  std::string name = "run";
  std::int64_t seed = 1;
  bool deterministic = false;
  std::int64_t max_steps = 2000000;
  double max_seconds = 0.0;
  double updates_per_step = 0.25;
  std::int64_t learning_starts = 4096;
  int publish_interval = 10;
  int queue_length = 4;
  int simulation_threads = 1;
  double log_interval = 1.0;
  double checkpoint_seconds = 60.0;
  std::int64_t checkpoint_steps = 0;
  KeepCheckpoints keep_checkpoints = KeepCheckpoints::kNewest;
  std::vector<double> snapshot_seconds;
  std::vector<int> snapshot_steps;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("name", name, "The run's directory below runs/.");
    v("seed", seed, base::Range{0, 9.0e15}, "",
      "Seed from which all random streams of the run are derived.");
    v("deterministic", deterministic,
      "Simulate and learn in turn, on one thread: the same seed then gives the same policy, bit "
      "for bit, however often the run is resumed.");
    v("max_steps", max_steps, base::Range{1, 1.0e12}, "",
      "Environment steps after which training ends.");
    v("max_seconds", max_seconds, base::Range{0.0, 1.0e7}, "s",
      "Training time after which training ends. Resumed sessions add up; evaluations do not count. "
      "0: no limit.");
    v("updates_per_step", updates_per_step, base::Range{1e-6, 100.0}, "",
      "Learner updates per environment step. The rate limiter keeps this ratio.");
    v("learning_starts", learning_starts, base::Range{0, 1.0e9}, "",
      "Environment steps before the first update.");
    v("publish_interval", publish_interval, base::Range{1, 1000000}, "updates",
      "The actor gets new weights each time that this many updates were made.");
    v("queue_length", queue_length, base::Range{1, 1024}, "",
      "Batch steps by which the simulation may run ahead of the learner.");
    v("simulation_threads", simulation_threads, base::Range{1, 256}, "",
      "Threads that step environments.");
    v("log_interval", log_interval, base::Range{0.05, 3600.0}, "s",
      "Time between rows of metrics.csv.");
    v("checkpoint_seconds", checkpoint_seconds, base::Range{0.0, 1.0e6}, "s",
      "Time between checkpoints. 0: only at the end. Deterministic runs use checkpoint_steps "
      "instead.");
    v("checkpoint_steps", checkpoint_steps, base::Range{0, 1.0e12}, "",
      "Environment steps between checkpoints. 0: only checkpoint_seconds counts.");
    v("keep_checkpoints", keep_checkpoints,
      "What stays in checkpoints/ when the run has finished. newest: the newest checkpoint and its "
      "replay data, which a run that is resumed with a larger limit needs. all: both checkpoints. "
      "none: no checkpoint, so that the run cannot be resumed.");
    v("snapshot_seconds", snapshot_seconds, base::Range{0.0, 1.0e7}, "s",
      "Training times at which a copy of the policy is kept. After training, each copy is scored "
      "on the test courses (curve.csv).");
    v("snapshot_steps", snapshot_steps, base::Range{0.0, 2.0e9}, "",
      "Numbers of environment steps at which a copy of the policy is kept and scored likewise.");
  }
};

}  // namespace slalom::run
