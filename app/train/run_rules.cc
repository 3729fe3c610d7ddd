#include "app/train/run_rules.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string>
#include <vector>

#include "app/train/run_limits.h"
#include "base/config.h"
#include "base/error.h"
#include "learner/method_rules.h"
#include "replay/sample_bytes.h"
#include "sim/randomized_config.h"

namespace slalom::train {
namespace {

constexpr std::size_t kMaxReplayServers = 64;

/// Throws unless `is_met`, because `key` would need a robot on courses.
void RequireForOwn(bool is_met, std::string_view key, std::string_view expected) {
  if (is_met) return;
  throw base::Error(
      "{}: expected {} with task.observation_size above 0: it is about robots on courses", key,
      expected);
}

/// Throws if no episode would be on a learnable course although they are asked for.
void RequireSampling(const CoursesConfig& courses) {
  const bool has_fresh = !courses.Mix().empty();  // Names are checked.
  const actor::SamplingConfig& sampling = courses.sampling;
  if (sampling.sampling != actor::Sampling::kLearnable) return;
  base::ThrowIf(
      has_fresh && sampling.fresh_episodes == 1,
      "courses.fresh_episodes is 1, expected at least 2 with courses.sampling = \"learnable\": a "
      "course is learnable if some of its episodes succeed and others fail");
  base::ThrowIf(
      sampling.learnable_share == 0.0,
      "courses.learnable_share is 0, expected more with courses.sampling = \"learnable\": "
      "without a share of the episodes it has no effect");
}

void RequireTask(const RunConfig& config) {
  const TaskConfig& task = config.task;
  const std::size_t num_bounds = task.action_low.size();
  if (!task.is_own()) return;
  base::ThrowIf(
      num_bounds < 1 || num_bounds > env::kMaxActionSize || task.action_high.size() != num_bounds,
      "task.action_low has {} numbers and task.action_high {}, expected the same number, from 1 "
      "to {}",
      num_bounds, task.action_high.size(), env::kMaxActionSize);
  for (std::size_t i = 0; i < num_bounds; ++i) {
    if (task.action_low[i] < task.action_high[i]) continue;
    throw base::Error("task.action_low[{}] is {}, expected less than task.action_high[{}] = {}", i,
                      task.action_low[i], i, task.action_high[i]);
  }
  RequireForOwn(config.network.sectors == 0, "network.sectors", "0");
  RequireForOwn(!config.method.learner.mirror, "learner.mirror", "false");
  RequireForOwn(config.method.model.kind == nn::ModelKind::kNone, "model.kind", "\"none\"");
}

void RequireReachableLimit(const RunConfig& config) {
  const learner::ConstraintConfig& constraint = config.method.constraint;
  const bool costs_at_most_one = !config.task.is_own() && config.environment.episode.collision_ends;
  if (constraint.kind != learner::ConstraintKind::kLagrangian || !costs_at_most_one ||
      constraint.limit < 1.0) {
    return;
  }
  throw base::Error(
      "constraint.limit is {}, expected less than 1 with constraint.kind = \"lagrangian\": an "
      "episode ends with its first collision, so the multiplier would never rise",
      constraint.limit);
}

/// Throws if teachers cannot be chosen by the kind of a course.
void RequireKindsOfCourses(const RunConfig& config) {
  const learner::LearnerConfig& learner = config.method.learner;
  if (!learner::TraitsOf(learner).is_taught || !config.courses.has_named()) return;
  throw base::Error(
      "courses.train is \"{}\" and courses.fresh \"{}\", expected \"\" and kinds of courses with "
      "learner.algorithm = \"{}\", whose teachers are chosen by the kind",
      config.courses.train, config.courses.fresh, learner.algorithm);
}

/// Frames that the longest window of an update spans when every environment adds to the replay.
std::int64_t WindowFrames(const RunConfig& config) {
  int longest = 0;
  for (const replay::SampleSpec& spec :
       learner::SampleSpecs(config.method, MakePolicySpec(config))) {
    longest = std::max(longest, spec.history + spec.n_step);
  }
  return static_cast<std::int64_t>(longest) * config.actor.num_environments;
}

/// Throws if the limits of the service's roles are incompatible.
void RequireServable(const RunConfig& config) {
  base::ThrowIf(
      learner::TraitsOf(config.method.learner).is_taught,
      "learner.algorithm is \"{}\", expected one that learns from rewards: the service's actors "
      "have no teachers; `slalom train` has",
      config.method.learner.algorithm);
  const std::vector<std::string>& servers = config.service.replay;
  base::ThrowIf(servers.empty() || servers.size() > kMaxReplayServers,
                "service.replay lists {} addresses, expected 1 to {}", servers.size(),
                kMaxReplayServers);
  for (auto it = servers.begin(); it != servers.end(); ++it) {
    base::ThrowIf(std::find(servers.begin(), it, *it) != it,
                  "service.replay lists {} twice, expected each replay server once", *it);
  }
  const auto num_servers = static_cast<std::int64_t>(servers.size());
  base::ThrowIf(config.replay.capacity / num_servers < WindowFrames(config),
                "replay.capacity is {}, expected at least {}: each of {} replay servers holds its "
                "share, which must hold the windows of an update",
                config.replay.capacity, num_servers * WindowFrames(config), num_servers);
  const int rows = LargestChunkRows(config);
  const std::int64_t bytes = LargestChunkBytes(config);
  base::ThrowIf(
      bytes > config.replay_server.max_message_bytes,
      "actor_service.chunk_rows is {} and actor.num_environments {}: a message may have {} rows "
      "and {} bytes, expected at most replay_server.max_message_bytes = {}",
      config.actor_service.chunk_rows, config.actor.num_environments, rows, bytes,
      config.replay_server.max_message_bytes);
  for (const replay::SampleSpec& spec :
       learner::SampleSpecs(config.method, MakePolicySpec(config))) {
    const auto size = replay::SampleSize({.batch = spec.batch,
                                          .history = spec.history,
                                          .step = StepShapeOf(config),
                                          .weighted = spec.prioritized});
    if (size && *size <= static_cast<std::size_t>(config.replay_server.max_sample_bytes)) continue;
    throw base::Error(
        "learner.batch_size is {} and model_training.batch_size {}: a batch of {} windows of {} "
        "scans has {} bytes, expected at most replay_server.max_sample_bytes = {}",
        config.method.learner.batch_size, config.method.model_training.batch_size, spec.batch,
        spec.history, size.value_or(0), config.replay_server.max_sample_bytes);
  }
}

void RequireEndBySteps(const RunConfig& config) {
  if (!config.run.deterministic) return;
  const auto needed = OverridesForDeterminism(config);
  if (needed.empty()) return;
  throw base::Error(
      "run.deterministic is true, expected a run that ends by steps, not by seconds: --set {}",
      fmt::join(needed, " --set "));
}

}  // namespace

void RequireSound(const RunConfig& config, const RunUse& use) {
  sim::CheckRandomization(config.environment);
  RequireSampling(config.courses);
  RequireTask(config);
  RequireReachableLimit(config);
  learner::RequireConsistent(config.method);
  if (config.mpc.enabled) RequireNoConstraint(config);
  RequireKindsOfCourses(config);
  RunConfig copy = config;
  RunConfig defaults;
  config::RequireRead(config::ListFields(copy), config::ListFields(defaults));
  if (!use.drives.empty()) RequireCourses(config, use.drives);
  if (use.begins) RequireLearnable(config);
  if (use.serves) {
    RequireServable(config);
  } else {
    RequireEndBySteps(config);
  }
}

void RequireCourses(const RunConfig& config, std::string_view who) {
  if (!config.task.is_own()) return;
  throw base::Error(
      "task.observation_size is {}, expected 0 for {}, which drives robots on courses: your own "
      "environment is driven by slalom.Actor (docs/python.md)",
      config.task.observation_size, who);
}

void RequireNoConstraint(const RunConfig& config) {
  if (config.method.constraint.kind == learner::ConstraintKind::kNone) return;
  throw base::Error(
      "mpc.enabled is true, expected constraint.kind = \"none\", found \"{}\": a plan is weighed "
      "by its rewards alone, as a model predicts no cost",
      base::EnumName(config.method.constraint.kind));
}

void RequireLearnable(const RunConfig& config) {
  base::ThrowIf(
      config.run.max_steps <= FirstUpdate(config),
      "run.max_steps is {}, expected more than {}, or nothing is learned: the first update comes "
      "after run.learning_starts = {} steps and the steps that pay for it (run.updates_per_step "
      "= {})",
      config.run.max_steps, FirstUpdate(config), config.run.learning_starts,
      config.run.updates_per_step);
  base::ThrowIf(
      config.replay.capacity < WindowFrames(config),
      "replay.capacity is {}, expected at least {}: an update samples windows of {} frames from "
      "each of actor.num_environments = {}",
      config.replay.capacity, WindowFrames(config),
      WindowFrames(config) / config.actor.num_environments, config.actor.num_environments);
}

}  // namespace slalom::train
