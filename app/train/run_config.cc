#include "app/train/run_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "base/random.h"
#include "replay/rows.h"
#include "sim/courses/course_file.h"
#include "sim/courses/course_sets.h"
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

/// When the run's episodes end in success.
nn::GoalRule GoalOf(const RunConfig& config) {
  return {.radius = config.environment.episode.goal_tolerance,
          .reward = config.environment.reward.success * config.method.learner.reward_scale};
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
  RunConfig defaults;
  config::ResetUnread(fields, config::ListFields(defaults));
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

int LargestChunkRows(const RunConfig& config) {
  return config.actor_service.chunk_rows - 1 + 2 * config.actor.num_environments;
}

std::int64_t LargestChunkBytes(const RunConfig& config) {
  return static_cast<std::int64_t>(
      replay::RowBytes::Size(LargestChunkRows(config), StepShapeOf(config)));
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

template slalom::config::FieldList slalom::config::ListFields(slalom::train::RunConfig& config);
