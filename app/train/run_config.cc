#include "app/train/run_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "app/train/stages.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "base/random.h"
#include "learner/method_rules.h"
#include "replay/rows.h"
#include "replay/sample_bytes.h"
#include "sim/courses/course_file.h"
#include "sim/courses/course_sets.h"
#include "sim/randomized_config.h"
#include "sim/scene.h"
#include "sim/scene_stream.h"

namespace slalom::train {
namespace {

sim::CourseSet ResolveKey(std::string_view key, const CoursesConfig& courses,
                          const std::string& spec) {
  try {
    return courses.Resolve(spec);
  } catch (const base::Error& error) {
    throw base::Error(fmt::format("{}: {}", key, error.what()));
  }
}

/// Throws unless `is_met`, because `key` would need a robot on courses.
void RequireForOwn(bool is_met, std::string_view key, std::string_view expected) {
  if (is_met) return;
  throw base::Error(fmt::format(
      "{}: expected {} with task.observation_size above 0: it is about robots on courses", key,
      expected));
}

void RequireTeachers(const RunConfig& config) {
  const std::string& algorithm = config.method.learner.algorithm;
  if (!learner::TraitsOf(config.method.learner).is_taught) return;
  if (config.courses.has_named()) {
    throw base::Error(fmt::format(
        "courses.train is \"{}\" and courses.fresh \"{}\", expected \"\" and kinds of courses with "
        "learner.algorithm = \"{}\", whose teachers are chosen by the kind",
        config.courses.train, config.courses.fresh, algorithm));
  }
  (void)TeacherFiles(config, "");
  for (const Stage& stage : StagesOf(config)) {
    try {
      RequireCombination(stage.config);
    } catch (const base::Error& error) {
      throw base::Error(fmt::format("distillation.stages.{}: {}", stage.name, error.what()));
    }
  }
}

/// Throws if no episode would be on a learnable course although they are asked for.
void RequireSampling(const CoursesConfig& courses) {
  const bool has_fresh = !courses.Mix().empty();  // Names are checked.
  const actor::SamplingConfig& sampling = courses.sampling;
  if (sampling.sampling != actor::Sampling::kLearnable) return;
  if (has_fresh && sampling.fresh_episodes == 1) {
    throw base::Error(
        "courses.fresh_episodes is 1, expected at least 2 with courses.sampling = \"learnable\": a "
        "course is learnable if some of its episodes succeed and others fail");
  }
  if (sampling.learnable_share == 0.0) {
    throw base::Error(
        "courses.learnable_share is 0, expected more with courses.sampling = \"learnable\": "
        "without "
        "a share of the episodes it has no effect");
  }
}

void RequireTask(const RunConfig& config) {
  const TaskConfig& task = config.task;
  const std::size_t num_bounds = task.action_low.size();
  if (!task.is_own()) return;
  if (num_bounds < 1 || num_bounds > env::kMaxActionSize || task.action_high.size() != num_bounds) {
    throw base::Error(fmt::format(
        "task.action_low has {} numbers and task.action_high {}, expected the same number, from 1 "
        "to {}",
        num_bounds, task.action_high.size(), env::kMaxActionSize));
  }
  for (std::size_t i = 0; i < num_bounds; ++i) {
    if (task.action_low[i] < task.action_high[i]) continue;
    throw base::Error(
        fmt::format("task.action_low[{}] is {}, expected less than task.action_high[{}] = {}", i,
                    task.action_low[i], i, task.action_high[i]));
  }
  RequireForOwn(config.network.sectors == 0, "network.sectors", "0");
  RequireForOwn(!config.method.learner.mirror, "learner.mirror", "false");
  RequireForOwn(config.method.model.kind == nn::ModelKind::kNone, "model.kind", "\"none\"");
  RequireForOwn(!config.mpc.enabled, "mpc.enabled", "false");
}

void RequireReachableLimit(const RunConfig& config) {
  const learner::ConstraintConfig& constraint = config.method.constraint;
  const bool costs_at_most_one = !config.task.is_own() && config.environment.episode.collision_ends;
  if (constraint.kind != learner::ConstraintKind::kLagrangian || !costs_at_most_one ||
      constraint.limit < 1.0) {
    return;
  }
  throw base::Error(fmt::format(
      "constraint.limit is {}, expected less than 1 with constraint.kind = \"lagrangian\": an "
      "episode ends with its first collision, so the multiplier would never rise",
      constraint.limit));
}

/// When the run's episodes end in success.
nn::GoalRule GoalOf(const RunConfig& config) {
  return {.radius = config.environment.episode.goal_tolerance,
          .reward = config.environment.reward.success * config.method.learner.reward_scale};
}

/// A batch step begins below the limit and adds a row for each environment, and one more frame if
/// its episode ends.
int LargestChunkRows(const RunConfig& config) {
  return config.actor_service.chunk_rows - 1 + 2 * config.actor.num_environments;
}

}  // namespace

std::string CopyName(const std::string& named, std::string_view identity,
                     std::string_view extension) {
  const std::string stem = std::filesystem::path(named).stem().string();
  return fmt::format("{}-{:016x}{}", sim::IsCourseName(stem) ? stem : "copy",
                     base::Checksum(identity), extension);
}

std::filesystem::path CollectionConfig::CopyOf(const std::string& spec) const {
  return inputs / CopyName(spec, fmt::format("{}\n{}\n{}", spec, collection, generator_seed),
                           sim::kCourseSetExtension);
}

sim::CourseSet CollectionConfig::Resolve(const std::string& spec) const {
  if (const auto copy = CopyOf(spec); !inputs.empty() && base::Exists(copy)) {
    sim::CourseSet set = sim::ReadCourseSet(copy);
    if (set.name == copy.stem().string()) set.name = spec;  // The file has none.
    return set;
  }
  return sim::ResolveCourses(spec, collection, static_cast<std::uint64_t>(generator_seed));
}

std::string CoursesConfig::DescribeTrain() const {
  if (fresh == "none") return train;
  return fmt::format("{}fresh courses ({})", train.empty() ? "" : train + " and ", fresh);
}

sim::FreshMix CoursesConfig::Mix() const {
  try {
    return sim::ParseFreshMix(fresh);
  } catch (const base::Error& error) {
    throw base::Error(fmt::format("courses.fresh: {}", error.what()));
  }
}

sim::CourseSet CoursesConfig::ResolveTrain() const {
  if (!has_named()) return {};
  return ResolveKey("courses.train", *this, train);
}

sim::CourseSet CoursesConfig::ResolveTest() const {
  return ResolveKey("courses.test", *this, test);
}

RunConfig ReadRecordedConfig(std::string_view text, std::string_view source) {
  RunConfig config;
  const config::FieldList fields = config::ListFields(config);
  std::string known;
  std::vector<std::string> unknown;
  for (const auto& [key, value] : config::FlattenToml(text, source)) {
    if (config::HasKey(fields, key)) {
      known += fmt::format("{} = {}\n", key, value.text);
    } else {
      unknown.push_back(key);
    }
  }
  if (unknown.empty()) {
    config::ReadToml(text, source, fields);  // Its errors name lines.
  } else {
    spdlog::warn("{}: unknown keys, of a newer version of the program, are left out: {}", source,
                 fmt::join(unknown, ", "));
    config::ReadToml(known, source, fields);
  }
  return config;
}

std::optional<RunConfig> TrainedConfig(const nn::Metadata& metadata, std::string_view policy_file) {
  const auto it = metadata.find("config");
  if (it == metadata.end()) return std::nullopt;
  return ReadRecordedConfig(it->second, fmt::format("{} (its config)", policy_file));
}

std::uint64_t SeedOf(const RunConfig& config, std::string_view purpose) {
  return base::DeriveSeed(static_cast<std::uint64_t>(config.run.seed), purpose);
}

policy::PolicySpec MakePolicySpec(const RunConfig& config) {
  const env::StepShape shape = StepShapeOf(config);
  env::ObservationSpec observation = sim::MakeObservationSpec(config.environment);
  if (config.task.is_own()) {
    observation.num_beams = shape.num_beams;
    observation.state_size = shape.state_size;
  }
  return {.observation = observation,
          .network = config.network,
          .action_size = shape.action_size,
          .actions = config.environment.action,
          .distribution = learner::DistributionOf(config.method.learner),
          .planning = learner::PlanningOf(config.method, GoalOf(config))};
}

sim::EnvironmentConfig TrainingEnvironment(const RunConfig& config) {
  sim::EnvironmentConfig environment = config.environment;
  environment.observation.privileged |= learner::TraitsOf(config.method.learner).is_taught;
  return environment;
}

env::StepShape StepShapeOf(const RunConfig& config) {
  if (!config.task.is_own()) {
    const env::ObservationSpec spec = sim::MakeObservationSpec(TrainingEnvironment(config));
    return {spec.num_beams, spec.state_size};
  }
  return {0, config.task.observation_size, static_cast<int>(config.task.action_low.size())};
}

sim::CourseEnvironments MakeTrainingEnvironments(const RunConfig& config,
                                                 base::ParallelFor& parallel) {
  sim::FreshMix mix = config.courses.Mix();
  auto fresh =
      mix.empty()
          ? nullptr
          : std::make_unique<sim::SceneStream>(
                std::move(mix), SeedOf(config, "fresh courses"),
                config.courses.sampling.learnable_courses + 2 * config.actor.num_environments);
  return sim::CourseEnvironments(
      TrainingEnvironment(config), sim::MakeScenes(config.courses.ResolveTrain()),
      config.actor.num_environments, &parallel, sim::MakeRobots(), std::move(fresh));
}

int BatchesPerUpdate(const RunConfig& config) {
  return static_cast<int>(learner::SampleSpecs(config.method, MakePolicySpec(config)).size());
}

void RequireCombination(const RunConfig& config) {
  sim::CheckRandomization(config.environment);
  RequireSampling(config.courses);
  RequireTask(config);
  RequireReachableLimit(config);
  learner::RequireConsistent(config.method);
  if (config.mpc.enabled) RequireNoConstraint(config);
  RequireTeachers(config);
  RunConfig copy = config;
  RunConfig defaults;
  config::RequireRead(config::ListFields(copy), config::ListFields(defaults));
}

void RequireCourses(const RunConfig& config, std::string_view who) {
  if (!config.task.is_own()) return;
  throw base::Error(fmt::format(
      "task.observation_size is {}, expected 0 for {}, which drives robots on courses: your own "
      "environment is driven by slalom.Actor (docs/python.md)",
      config.task.observation_size, who));
}

void RequireNoConstraint(const RunConfig& config) {
  if (config.method.constraint.kind == learner::ConstraintKind::kNone) return;
  throw base::Error(fmt::format(
      "mpc.enabled is true, expected constraint.kind = \"none\", found \"{}\": a plan is weighed "
      "by its rewards alone, as a model predicts no cost",
      base::EnumName(config.method.constraint.kind)));
}

std::int64_t LargestChunkBytes(const RunConfig& config) {
  return static_cast<std::int64_t>(
      replay::RowBytes::Size(LargestChunkRows(config), StepShapeOf(config)));
}

void RequireServable(const RunConfig& config) {
  if (learner::TraitsOf(config.method.learner).is_taught) {
    throw base::Error(fmt::format(
        "learner.algorithm is \"{}\", expected one that learns from rewards: the service's actors "
        "have no teachers; `slalom train` has",
        config.method.learner.algorithm));
  }
  const int rows = LargestChunkRows(config);
  const std::int64_t bytes = LargestChunkBytes(config);
  if (bytes > config.replay_server.max_message_bytes) {
    throw base::Error(fmt::format(
        "actor_service.chunk_rows is {} and actor.num_environments {}: a message may have {} rows "
        "and {} bytes, expected at most replay_server.max_message_bytes = {}",
        config.actor_service.chunk_rows, config.actor.num_environments, rows, bytes,
        config.replay_server.max_message_bytes));
  }
  for (const replay::SampleSpec& spec :
       learner::SampleSpecs(config.method, MakePolicySpec(config))) {
    const auto size = replay::SampleSize({.batch = spec.batch,
                                          .history = spec.history,
                                          .step = StepShapeOf(config),
                                          .weighted = spec.prioritized});
    if (size && *size <= static_cast<std::size_t>(config.replay_server.max_sample_bytes)) continue;
    throw base::Error(fmt::format(
        "learner.batch_size is {} and model_training.batch_size {}: a batch of {} windows of {} "
        "scans has {} bytes, expected at most replay_server.max_sample_bytes = {}",
        config.method.learner.batch_size, config.method.model_training.batch_size, spec.batch,
        spec.history, size.value_or(0), config.replay_server.max_sample_bytes));
  }
}

std::uint64_t SpecHash(const RunConfig& config) {
  std::uint64_t hash =
      base::Checksum(config::Changes(config.environment),
                     base::Checksum(config::Changes(config.network),
                                    base::Checksum(config.method.learner.algorithm)));
  if (config.task.is_own()) hash = base::Checksum(config::Changes(config.task), hash);
  const policy::PlanningSpec planning = learner::PlanningOf(config.method);
  if (planning.is_carried()) hash = base::Checksum(config::Changes(planning.model), hash);
  return hash;
}

}  // namespace slalom::train
