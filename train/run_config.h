#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "actor/actor_config.h"
#include "actor/service/actor_service_config.h"
#include "base/config_field.h"
#include "eval/evaluation_config.h"
#include "eval/service/evaluator_service_config.h"
#include "learner/learner.h"
#include "learner/service/learner_service_config.h"
#include "nn/network_config.h"
#include "policy/mpc_config.h"
#include "policy/policy.h"
#include "replay/service/config.h"
#include "replay/table.h"
#include "sim/courses/course.h"
#include "sim/environment_config.h"
#include "train/service_config.h"
#include "transport/security.h"

namespace slalom::train {

/// Which courses a run trains and is scored on.
struct CoursesConfig {
  std::string train = "static-train-50";
  std::string test = "static-test";
  std::string collection;
  std::int64_t generator_seed = 1;

  /// The set that `spec` names (`sim::ResolveCourses`, with its errors) under this collection and
  /// seed.
  sim::CourseSet Resolve(const std::string& spec) const;
  /// The sets of `train` and `test`. Errors name the key, too.
  sim::CourseSet ResolveTrain() const;
  sim::CourseSet ResolveTest() const;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("train", train,
      "Courses to train on: a set's name, generated:SEED:COUNT, or a file (docs/courses.md).");
    v("test", test,
      "Courses on which the trained policy is scored; they should not be among the training "
      "courses. Empty: it is not scored.");
    v("collection", collection,
      "Directory of imported courses in which set names are looked up. Empty: they name sets of "
      "the built-in generator.");
    v("generator_seed", generator_seed, base::Range{0, 9.0e15}, "",
      "Seed of the built-in generator.");
  }
};

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
  std::string keep_checkpoints = "newest";
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
    v("keep_checkpoints", keep_checkpoints, base::OneOf{"newest", "all", "none"}, "",
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

/// Everything a run is made of: what a TOML file holds, and what a checkpoint and a policy carry.
struct RunConfig {
  RunSettings run;
  CoursesConfig courses;
  sim::EnvironmentConfig environment;
  actor::ActorConfig actor;
  replay::ReplayConfig replay;
  nn::NetworkConfig network;
  learner::MethodConfig method;
  policy::MpcConfig mpc;
  eval::EvaluationConfig evaluation;
  ServiceConfig service;
  transport::SecurityConfig security;
  replay::ReplayServerConfig replay_server;
  learner::LearnerServiceConfig learner_service;
  actor::ActorServiceConfig actor_service;
  eval::EvaluatorServiceConfig evaluator_service;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("run", run, "Length, seed and rhythm of the run.");
    v.Section("courses", courses, "Training and test courses.");
    v.Section("environment", environment, "The robot, its sensor and the task.");
    v.Section("actor", actor, "How training episodes are driven.");
    v.Section("replay", replay, "The replay buffer.");
    v.Section("network", network, "Networks of actor and critics.");
    v.Section("learner", method.learner, "The algorithm (docs/algorithms.md).");
    v.Section("constraint", method.constraint, "Safe RL: how often the robot may collide.");
    v.Section("model", method.model, "The transition model (docs/models.md).");
    v.Section("model_training", method.model_training, "How the transition model is trained.");
    v.Section("imagination", method.imagination,
              "Learning from transitions that the model imagines.");
    v.Section("mpc", mpc, "Planning with the transition model.");
    v.Section("evaluation", evaluation, "The protocol of evaluations.");
    v.Section("service", service,
              "Addresses and state of the distributed service. `slalom train` needs neither this "
              "section nor those below.");
    v.Section("security", security, "Keys of the distributed service.");
    v.Section("replay_server", replay_server, "The replay server.");
    v.Section("learner_service", learner_service, "The learner as a process of its own.");
    v.Section("actor_service", actor_service, "The actor as a process of its own.");
    v.Section("evaluator_service", evaluator_service, "The evaluator as a process of its own.");
  }
};

/// The seed of one of the run's random streams.
std::uint64_t SeedOf(const RunConfig& config, std::string_view purpose);

/// What the run's policies see, are and command.
policy::PolicySpec MakePolicySpec(const RunConfig& config);

/// Batches that an update learns from, one of each kind. The replay server counts batches.
int BatchesPerUpdate(const RunConfig& config);

/// Throws `base::Error` where sections that are each well do not go together, whichever program the
/// config is for.
void RequireCombination(const RunConfig& config);
/// Throws `base::Error` where policies of the run are made under a constraint, which planning with
/// them would pass over.
void RequireNoConstraint(const RunConfig& config);

/// Throws `base::Error` where the roles of a service would not get on with each other.
void RequireServable(const RunConfig& config);

/// Of what is observed, commanded and learned: processes of two runs whose hashes differ refuse
/// each other. Of the keys that are not at their defaults, so that versions of which one has more
/// keys agree.
std::uint64_t SpecHash(const RunConfig& config);

}  // namespace slalom::train
