#pragma once

#include <stop_token>

#include "app/train/trainer.h"
#include "policy/policy.h"

namespace slalom::train {

/// A run of some seconds: few courses, a small net, everything else as in the fast preset.
inline RunConfig SmallRun() {
  RunConfig config;
  config.run.deterministic = true;
  config.run.max_steps = 6000;
  config.run.updates_per_step = 1.0 / 32;
  config.run.learning_starts = 500;
  config.run.publish_interval = 7;
  config.run.log_interval = 0.05;
  config.courses.train = "static-train-5";
  config.actor.num_environments = 8;
  config.actor.warmup_steps = 300;
  config.replay.capacity = 2000;
  config.network.encoder_layers = {};
  config.network.head_layers = {16, 16};
  config.network.sectors = 72;
  config.method.learner.batch_size = 32;
  config.method.learner.mirror = true;
  config.method.learner.average_rate = 0.01;
  config.method.learner.actor_learning_rate = 1e-3;
  config.method.learner.critic_learning_rate = 1e-3;
  return config;
}

inline ResolvedRun ResolveForTraining(const RunConfig& config, bool resume = false) {
  return Resolve(config, {.drives = "slalom train", .begins = !resume});
}

inline policy::PolicySnapshot Policy(const run::RunDirectory& directory) {
  return policy::LoadPolicy(directory.policy()).snapshot;
}

inline TrainingEnd RunOnce(const RunConfig& config, const run::RunDirectory& directory,
                           bool resume = false, std::stop_token stop = {},
                           const run::TrainingClock& clock = run::TrainingClock()) {
  metrics::Registry registry("train", "test");
  Trainer trainer(ResolveForTraining(config, resume), directory, "test", resume, registry, clock);
  return trainer.Run(stop);
}

}  // namespace slalom::train
