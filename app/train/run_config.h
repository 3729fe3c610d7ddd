#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "actor/actor_config.h"
#include "actor/course_sampler.h"
#include "actor/service/actor_service_config.h"
#include "app/train/distillation_config.h"
#include "app/train/service_config.h"
#include "app/train/task_config.h"
#include "base/config_field.h"
#include "eval/evaluation_config.h"
#include "eval/service/evaluator_service_config.h"
#include "learner/method.h"
#include "learner/run/run_settings.h"
#include "learner/service/learner_service_config.h"
#include "planners/guard/guard_config.h"
#include "policy/mpc_config.h"
#include "policy/nn/network_config.h"
#include "policy/policy.h"
#include "proto/transport/security.h"
#include "replay/service/config.h"
#include "replay/table.h"
#include "sim/courses/course.h"
#include "sim/courses/course_stream.h"
#include "sim/environment_config.h"
#include "sim/environments.h"

namespace slalom::train {

/// The name of the copy of a file or course set `named`: "bend-0123456789abcdef.courses".
/// `identity`: a text that tells it from others of this name.
std::string CopyName(const std::string& named, std::string_view identity,
                     std::string_view extension);

/// Where names of course sets are looked up.
struct CollectionConfig {
  std::string collection;
  std::int64_t generator_seed = 1;
  /// Not a key: the directory in which a run keeps copies of what its config names
  /// (app/train/inputs.h). Empty: there are none.
  std::filesystem::path inputs{};

  /// Returns the set that `spec` names: its copy in `inputs`, or as `sim::ResolveCourses` does,
  /// with its errors.
  sim::CourseSet Resolve(const std::string& spec) const;
  /// The file of the copy of that set. Requires: `inputs` is not empty.
  std::filesystem::path CopyOf(const std::string& spec) const;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("collection", collection,
      "Directory of imported courses in which set names are looked up. Empty: they name sets of "
      "the built-in generator.");
    v("generator_seed", generator_seed, base::Range{0, 9.0e15}, "",
      "Seed of the built-in generator.");
  }
};

/// Which courses a run trains and is scored on.
struct CoursesConfig : CollectionConfig {
  std::string train = "static-train-50";
  std::string test = "static-test";
  std::string fresh = "none";
  actor::SamplingConfig sampling;

  /// Whether there are training courses besides fresh ones.
  bool has_named() const { return !train.empty() || fresh == "none"; }
  /// Returns the kinds of `fresh`. The error of `sim::ParseFreshMix` names the key, too.
  sim::FreshMix Mix() const;
  /// Description of the training courses, for people.
  std::string DescribeTrain() const;
  /// Return the sets of `train` and `test`. Errors name the key, too.
  sim::CourseSet ResolveTrain() const;
  sim::CourseSet ResolveTest() const;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("train", train,
      "Courses to train on: a set's name, generated:SEED:COUNT, a file, or several of these joined "
      "by + (docs/courses.md). Empty: only fresh ones (courses.fresh).");
    v("fresh", fresh,
      "Generated courses without end to train on, besides those of courses.train or in their "
      "place: static, box, wall (with boxes or walls that move), crowds, halls, rooms, cylinders "
      "(that move, with the goal 20 m away), several of these in turn joined by +, or none.");
    sampling.Visit(v);
    v("test", test,
      "Courses on which the trained policy is scored; they should not be among the training "
      "courses. Empty: it is not scored.");
    CollectionConfig::Visit(v);
  }
};

/// All settings of a run, as a TOML file holds them and a checkpoint and a policy carry them.
struct RunConfig {
  run::RunSettings run;
  TaskConfig task;
  CoursesConfig courses;
  sim::EnvironmentConfig environment;
  actor::ActorConfig actor;
  replay::ReplayConfig replay;
  nn::NetworkConfig network;
  learner::MethodConfig method;
  DistillationConfig distillation;
  policy::MpcConfig mpc;
  planners::GuardConfig guard;
  eval::EvaluationConfig evaluation;
  ServiceConfig service;
  transport::SecurityConfig security;
  replay::ReplayServerConfig replay_server;
  learner::LearnerServiceConfig learner_service;
  actor::ActorServiceConfig actor_service;
  eval::EvaluatorServiceConfig evaluator_service;

  template <class Visitor>
  void Visit(Visitor& v) {
    const base::ReadIf with_model{"model.kind"};
    v.Section("run", run, "Length, seed and rhythm of the run.");
    v.Section("task", task, "An environment of your own in the place of a robot on courses.");
    v.Section("courses", courses, "Training and test courses.");
    v.Section("environment", environment, "The robot, its sensor and the task.");
    v.Section("actor", actor, "How training episodes are driven.");
    v.Section("replay", replay, "The replay buffer.");
    v.Section("network", network, "Networks of actor and critics.");
    v.Section("learner", method.learner, "The algorithm (docs/algorithms.md).");
    v.Section("constraint", method.constraint,
              "Safe RL: what an episode may cost, such as collisions.",
              base::ReadIf{"constraint.kind"});
    v.Section("model", method.model, "The transition model (docs/models.md).", with_model);
    v.Section("model_training", method.model_training, "How the transition model is trained.",
              with_model);
    v.Section("imagination", method.imagination,
              "Learning from transitions that the model imagines.",
              base::ReadIf{"imagination.kind"});
    v.Section("distillation", distillation, "Teachers of a policy that is distilled.",
              base::ReadIf{"learner.algorithm", {"distillation"}});
    v.Section("mpc", mpc, "Planning with the transition model.", with_model);
    v.Section("guard", guard, "A check of each action before the robot gets it.");
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

/// Reads the config that a policy, a checkpoint or a run directory holds. Keys that it lacks have
/// their defaults, as have those that nothing reads (`config::ResetUnread`), and unknown ones, of a
/// newer version, are left out with a warning. Throws `base::Error` that names `source` if it is
/// damaged.
RunConfig ReadRecordedConfig(std::string_view text, std::string_view source);

/// The config that a policy was trained with. Empty if its metadata does not hold it. Throws as
/// `ReadRecordedConfig`, naming `policy_file`.
std::optional<RunConfig> TrainedConfig(const nn::Metadata& metadata, std::string_view policy_file);

/// The seed of one of the run's random streams.
std::uint64_t SeedOf(const RunConfig& config, std::string_view purpose);

/// Observations, network and actions of the run's policies.
policy::PolicySpec MakePolicySpec(const RunConfig& config);

/// The task that the run's actors drive. It shows what no sensor tells if there are teachers, who
/// may see that, behind what the policy sees.
sim::EnvironmentConfig TrainingEnvironment(const RunConfig& config);

/// The sizes of a step of the run's environments.
env::StepShape StepShapeOf(const RunConfig& config);

/// Makes the environments that training episodes are driven in, on `parallel`'s threads. Throws
/// `base::Error` as their constructor does, and if the courses are not found.
sim::CourseEnvironments MakeTrainingEnvironments(const RunConfig& config,
                                                 base::ParallelFor& parallel);

/// Batches that an update learns from, one of each kind. The replay server counts batches.
int BatchesPerUpdate(const RunConfig& config);

/// Most rows of a chunk that the run's actors send: a batch step begins below the limit and adds a
/// row for each environment, and one more frame if its episode ends.
int LargestChunkRows(const RunConfig& config);
/// Size of the largest chunk that the run's actors send [bytes].
std::int64_t LargestChunkBytes(const RunConfig& config);

/// Hash of environment, network, algorithm and the model that policies carry; processes whose
/// hashes differ refuse each other. Keys at their defaults do not count, so a version with more
/// keys gives the same hash.
std::uint64_t SpecHash(const RunConfig& config);

}  // namespace slalom::train

extern template slalom::config::FieldList slalom::config::ListFields(
    slalom::train::RunConfig& config);
