#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "app/cli/commands.h"
#include "app/cli/course_selection.h"
#include "app/cli/output.h"
#include "app/cli/signals.h"
#include "app/train/command_options.h"
#include "app/train/policy_agents.h"
#include "app/train/profile.h"
#include "app/train/run_rules.h"
#include "app/train/scoring.h"
#include "base/config.h"
#include "base/error.h"
#include "base/exit_code.h"
#include "base/file.h"
#include "base/log.h"
#include "base/machine.h"
#include "eval/comparison/comparison.h"
#include "eval/comparison/printers.h"
#include "eval/evaluation_task.h"
#include "eval/report/report.h"
#include "eval/report/result.h"
#include "learner/run/run_directory.h"
#include "sim/engines/physics.h"
#include "sim/scene.h"

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

constexpr char kPhysicsFile[] = "physics.md";  // The table of several physics.

struct EvaluateOptions {
  std::optional<std::string> policy;
  std::optional<std::string> agent;
  std::string courses;
  std::optional<std::string> config;
  std::vector<std::string> profiles;
  std::vector<std::string> overrides;
  std::optional<std::string> protocol;
  std::string physics = "slalom";
  std::optional<std::string> name;
  std::optional<std::string> collection;
  std::optional<int> episodes;
  std::optional<std::int64_t> seed;
  std::optional<std::string> output;
  bool force = false;
  bool json = false;
  int threads = 0;
};

/// Throws `base::Error` for a key that the policy carries from its training: to set it has no
/// effect.
void RefuseKeysOfTraining(const std::vector<std::string>& overrides) {
  for (const std::string& assignment : overrides) {
    const bool is_read = std::ranges::any_of(
        std::array{"environment.", "evaluation.", "courses.", "guard.", "mpc.", "run.seed="},
        [&](std::string_view start) { return assignment.starts_with(start); });
    if (is_read) continue;
    throw base::Error(fmt::format(
        "--set {}: expected a key of [environment], [evaluation], [courses], [guard] or "
        "[mpc], or run.seed; everything else about a policy was fixed when it was trained",
        assignment));
  }
}

/// Throws `base::Error` if planning keys are set without `mpc.enabled`.
void RefusePlanningKeys(const std::vector<std::string>& overrides, const policy::MpcConfig& mpc) {
  for (const std::string& assignment : overrides) {
    if (mpc.enabled || !assignment.starts_with("mpc.") || assignment.starts_with("mpc.enabled=")) {
      continue;
    }
    throw base::Error(fmt::format(
        "--set {}: expected --set mpc.enabled=true as well, as nothing is planned without it",
        assignment));
  }
}

/// A key of the other kind of driver would be set in vain.
void RefuseKeysOfOthers(const EvaluateOptions& options, const config::FieldList& fields) {
  train::AnyConfig any;
  const config::FieldList others = config::ListFields(any);
  for (const std::string& assignment : options.overrides) {
    const std::string key = assignment.substr(0, assignment.find('='));
    if (options.agent) train::RequireReadBy(*options.agent, key, "--set " + assignment);
    if (config::HasKey(fields, key) || !config::HasKey(others, key)) continue;
    throw base::Error(fmt::format("--set {}: {} does not read this key", assignment,
                                  options.policy ? "a policy" : "a planner"));
  }
}

/// Lays profiles, overrides and options over `config`, in this order.
template <class Config>
void ApplyOptions(const EvaluateOptions& options, Config& config) {
  for (const std::string& file : options.profiles) {
    train::LayProfile(file, config.environment, config.guard);
  }
  const auto fields = config::ListFields(config);
  for (const std::string& assignment : options.overrides) {
    eval::RefuseRuleOfTask(assignment.substr(0, assignment.find('=')));
  }
  RefuseKeysOfOthers(options, fields);
  for (const std::string& assignment : options.overrides) {
    config::ApplyOverride(assignment, fields);
  }
  if (options.protocol) {
    config::ApplyOverride("evaluation.protocol=" + *options.protocol, fields);
  }
  if (options.collection) config.courses.collection = *options.collection;
  if (options.episodes) config.evaluation.episodes_per_course = *options.episodes;
  if (options.seed) config.evaluation.seed = *options.seed;
}

/// The config that the policy was trained with. Empty if the file does not hold it, or if this
/// program cannot read it and `--config` replaces it.
std::optional<train::RunConfig> TrainedConfig(const EvaluateOptions& options,
                                              const policy::LoadedPolicy& loaded) {
  try {
    return train::TrainedConfig(loaded.metadata, *options.policy);
  } catch (const base::Error& error) {
    if (!options.config) throw;
    spdlog::warn("cannot tell what the policy was trained on: {}", error.what());
    return std::nullopt;
  }
}

/// The config that the policy was trained with, or the file given in its place, with the options.
train::RunConfig TaskOf(const EvaluateOptions& options,
                        const std::optional<train::RunConfig>& trained) {
  train::RunConfig config = trained.value_or(train::RunConfig{});
  if (options.config) {
    config = {};
    planners::PlannersConfig others;
    const auto passed_over = config::ReadSharedTomlFile(*options.config, config::ListFields(config),
                                                        config::ListFields(others));
    if (!passed_over.empty()) {
      spdlog::info("{}: a policy does not read {}", *options.config, fmt::join(passed_over, ", "));
    }
  }
  ApplyOptions(options, config);
  RefuseKeysOfTraining(options.overrides);
  RefusePlanningKeys(options.overrides, config.mpc);
  return config;
}

/// Who names a run means its policy, but says so.
void RequireNoRunDirectory(const std::string& path) {
  std::error_code error;
  const fs::path policy = run::RunDirectory{path}.policy();
  if (!fs::is_directory(path, error) || !fs::exists(policy, error)) return;
  throw base::Error(fmt::format("{}: is a directory; did you mean '{}'?", path, policy.string()));
}

/// Throws `base::Error` if `mpc.enabled` is set for a policy that cannot plan.
void RequirePlannable(const std::string& path, const policy::PolicySnapshot& policy,
                      const train::RunConfig& config) {
  const policy::MpcConfig& mpc = config.mpc;
  if (!mpc.enabled) return;
  train::RequireNoConstraint(config);
  if (!policy.spec.planning.is_carried()) {
    throw base::Error(
        fmt::format("{}: carries no transition model, expected one because mpc.enabled is true: "
                    "train with model.kind = \"deterministic\" or \"probabilistic\"",
                    path));
  }
  if (policy.version < mpc.learning_starts) {
    throw base::Error(
        fmt::format("{}: has had {} updates, expected at least mpc.learning_starts = {} because "
                    "mpc.enabled is true: its model has seen too little to plan with",
                    path, policy.version, mpc.learning_starts));
  }
}

train::Scoring PrepareThePolicy(const EvaluateOptions& options) {
  RequireNoRunDirectory(*options.policy);
  const policy::LoadedPolicy loaded = policy::LoadPolicy(*options.policy);
  const auto trained = TrainedConfig(options, loaded);
  const train::RunConfig config = TaskOf(options, trained);
  if (trained) {
    train::RequireSameFieldOfView(*options.policy, trained->environment, config.environment);
  }
  RequirePlannable(*options.policy, loaded.snapshot, config);
  return train::PreparePolicy(train::MakeAgentsOf(loaded.snapshot, config), loaded.snapshot,
                              *options.policy, config, options.courses, trained);
}

train::Scoring PrepareThePlanner(const EvaluateOptions& options, base::ParallelFor& parallel) {
  const train::AgentRunConfig config = train::ResolveAgentRun([&](train::AgentRunConfig& task) {
    if (options.config) task = train::ReadAgentRunConfig(*options.config, task);
    ApplyOptions(options, task);
  });
  const std::string& protocol = config.evaluation.protocol;
  if (train::DefaultsOfPublishedRuns(protocol)) {
    const sim::RobotConfig& robot = config.environment.robot;
    spdlog::info(
        "protocol {}: robot.friction = \"{}\", robot.sensor_mass = {} kg; the published "
        "figures are from Gazebo and a Jackal with an LMS1xx (docs/planners.md)",
        protocol, base::EnumName(robot.friction), robot.sensor_mass);
  }
  return train::PreparePlanner(*options.agent, config, options.courses, parallel);
}

/// Directory of the scores in each physics: the output directory or, if there are several physics,
/// directories in it by their names.
std::vector<fs::path> OutputDirectories(const fs::path& output,
                                        const std::vector<sim::Physics>& physics) {
  if (physics.size() == 1) return {output};
  std::vector<fs::path> directories;
  directories.reserve(physics.size());
  for (const sim::Physics& each : physics) directories.push_back(output / each.name);
  return directories;
}

void RequireOutput(const EvaluateOptions& options, const std::vector<sim::Physics>& physics) {
  const fs::path output = *options.output;
  RequireOutputDirectory(output, options.force);
  if (physics.size() > 1) {
    for (const fs::path& directory : OutputDirectories(output, physics)) {
      RequireOutputDirectory(directory, options.force);
    }
  }
  base::MakeDirectories(output);
}

/// An error of any of the physics is reported before the first of them drives.
void RequireDrivable(const eval::EvaluationTask& task, const std::vector<sim::Physics>& physics) {
  sim::CheckConsistent(task.environment);
  const auto scenes = sim::MakeScenes(task.courses);
  for (const sim::Physics& each : physics) {
    if (each.make_bodies) (void)each.make_bodies(task.environment, scenes, 1);
  }
}

/// One evaluation, as text or JSON.
std::string OneReport(const train::Scores& scores, bool as_json) {
  return as_json ? eval::JsonReport(scores.evaluation, scores.provenance)
                 : eval::TextReport(scores.evaluation);
}

/// "Physics: slalom, mujoco 3.2."
std::string PhysicsSentence(const std::vector<eval::Result>& results) {
  std::vector<std::string> names;
  names.reserve(results.size());
  for (const eval::Result& result : results) {
    names.push_back(result.physics_version.empty()
                        ? result.physics
                        : fmt::format("{} {}", result.physics, result.physics_version));
  }
  return fmt::format("Physics: {}.", fmt::join(names, ", "));
}

/// Evaluations in several physics, compared.
std::string CompareInPhysics(const std::vector<train::Scores>& all, bool as_json) {
  std::vector<eval::Result> results;
  nlohmann::ordered_json reports = nlohmann::ordered_json::array();
  for (const train::Scores& scores : all) {
    results.push_back(eval::ResultOf(scores.evaluation, scores.provenance));
    const std::string report = eval::JsonReport(scores.evaluation, scores.provenance);
    reports.push_back(nlohmann::ordered_json::parse(report));
  }
  const eval::Comparison comparison = eval::CompareResults(results, eval::AgentsOf(results));
  if (!as_json) {
    return fmt::format("{}\n{}\n", eval::MarkdownOf(comparison.groups), PhysicsSentence(results));
  }
  const nlohmann::ordered_json object = {{"evaluations", std::move(reports)},
                                         {"comparison", eval::JsonOf(comparison.groups.front())}};
  return object.dump(2) + "\n";
}

int Evaluate(const EvaluateOptions& options) {
  StopSignals signals;
  const int threads = options.threads > 0 ? options.threads : base::NumProcessors();
  if (options.collection) RequireCollection(*options.collection);
  const std::vector<sim::Physics> physics = engines::FindPhysicsList(options.physics);
  if (options.output) RequireOutput(options, physics);
  base::ParallelFor parallel(threads);
  train::Scoring scoring =
      options.policy ? PrepareThePolicy(options) : PrepareThePlanner(options, parallel);
  if (options.name) scoring.provenance.agent = *options.name;
  scoring.provenance.profiles = options.profiles;
  if (physics.size() > 1) RequireDrivable(scoring.task, physics);
  std::vector<train::Scores> all;
  for (std::size_t k = 0; k < physics.size(); ++k) {
    scoring.task.physics = physics[k];
    auto scores = train::Score(scoring, parallel, signals.token());
    if (!scores) return base::kExitSignalBase + signals.received();
    if (options.output) WriteScores(*scores, OutputDirectories(*options.output, physics)[k]);
    all.push_back(std::move(*scores));
  }
  const std::string report =
      all.size() == 1 ? OneReport(all.front(), options.json) : CompareInPhysics(all, options.json);
  fmt::print("{}", report);
  if (options.output && all.size() > 1) {
    base::WriteFileAtomically(fs::path(*options.output) / kPhysicsFile,
                              CompareInPhysics(all, false));
  }
  if (options.output && !options.json) fmt::print("\nscores and pictures: {}/\n", *options.output);
  return base::kExitOk;
}

}  // namespace

void AddEvaluateCommand(CLI::App& app, int* exit_code) {
  CLI::App* command =
      app.add_subcommand("evaluate", "Score a policy or a classical planner on courses");
  command->footer(
      "Drives each course --episodes times, from jittered starts and with sensor noise whose "
      "random numbers training\n"
      "never uses (docs/evaluation.md). A policy drives the task that it was trained for, a "
      "planner the default task at 20 Hz,\n"
      "unless --config, --profile or --set changes it. The protocol decides when an episode ends; "
      "by dwa-runs and barn-challenge\n"
      "a planner's robot has Gazebo's friction and an LMS1xx, as that of the published figures. "
      "Examples:\n\n"
      "  slalom evaluate --policy runs/quickstart/policy.safetensors --courses static-test\n"
      "  slalom evaluate --agent dwa --courses static-test --output out/dwa\n"
      "  slalom evaluate --agent mppi --courses static-challenge --protocol barn-challenge\n"
      "  slalom evaluate --policy runs/quickstart/policy.safetensors --courses static-test "
      "--physics all\n"
      "  slalom evaluate --agent dwa --courses static-test --set "
      "environment.robot.command_delay=0.04\n");
  auto options = std::make_shared<EvaluateOptions>();
  CLI::Option_group* driver = command->add_option_group("driver", "Who drives");
  driver->add_option(train::kPolicyOption, options->policy, "Policy file (policy.safetensors)");
  driver->add_option(train::kAgentOption, options->agent,
                     fmt::format("Classical planner, or the oracle (docs/planners.md): {}",
                                 fmt::join(train::PlannerAndOracleNames(), ", ")));
  driver->require_option(1);
  command
      ->add_option(train::kCoursesOption, options->courses,
                   "Name of a set (see `slalom courses list`), generated:SEED:COUNT, or a course "
                   "or set file")
      ->required();
  command->add_option("--collection", options->collection,
                      "Directory of imported courses in which set names are looked up");
  command->add_option("--protocol", options->protocol,
                      "The rules: paper, dwa-runs or barn-challenge [paper]");
  command->add_option(
      train::kPhysicsOption, options->physics,
      "What moves the robot: slalom, ode or mujoco, several with commas, or all; "
      "several are compared in the same episodes (docs/physics-engines.md) [slalom]");
  command
      ->add_option("--profile", options->profiles,
                   "Lay the [environment] keys of this TOML file over the task (repeatable), for "
                   "example configs/real-robot.toml")
      ->type_name("FILE");
  command->add_option(train::kNameOption, options->name, "Name of the agent in reports");
  command->add_option("--episodes", options->episodes, "Episodes per course [10]")
      ->check(CLI::Range(1, 100000));
  command->add_option("--seed", options->seed, "Seed of the evaluation's random streams [1]")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{9'000'000'000'000'000}));
  command->add_option(train::kOutputOption, options->output,
                      "Directory for JSON, CSV, trajectories and pictures");
  command->add_flag(train::kForceOption, options->force, kForceHelp);
  command->add_flag("--json", options->json, "Print one JSON object instead of the table");
  command->add_option(train::kConfigOption, options->config,
                      "Take the task from this TOML file instead of the policy or the defaults");
  command->add_option("--set", options->overrides, "Override a key: section.key=value (repeatable)")
      ->type_name("KEY=VALUE");
  command
      ->add_option(train::kThreadsOption, options->threads,
                   "Number of threads, which changes only the speed [one per core]")
      ->check(CLI::Range(0, train::kMaxThreads));
  command->callback([options, exit_code] { *exit_code = Evaluate(*options); });
}

}  // namespace slalom::cli
