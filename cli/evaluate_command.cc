#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "cli/commands.h"
#include "cli/evaluate_policy.h"
#include "cli/signals.h"
#include "config/config.h"

namespace slalom::cli {
namespace {

struct EvaluateOptions {
  std::string policy;
  std::string courses;
  std::optional<std::string> config;
  std::vector<std::string> overrides;
  std::optional<std::string> collection;
  std::optional<int> episodes;
  std::optional<std::int64_t> seed;
  std::optional<std::string> output;
  bool json = false;
  int threads = 0;
};

/// The config that the policy was trained with, or the file given in its place, with the overrides.
train::RunConfig TaskOf(const EvaluateOptions& options, const policy::LoadedPolicy& loaded) {
  train::RunConfig config;
  const auto fields = config::ListFields(config);
  if (options.config) {
    config::ReadTomlFile(*options.config, fields);
  } else if (const auto it = loaded.metadata.find("config"); it != loaded.metadata.end()) {
    config::ReadToml(it->second, options.policy + " (its config)", fields);
  }
  for (const std::string& assignment : options.overrides) {
    config::ApplyOverride(assignment, fields);
  }
  if (options.collection) config.courses.collection = *options.collection;
  if (options.episodes) config.evaluation.episodes_per_course = *options.episodes;
  if (options.seed) config.evaluation.seed = *options.seed;
  return config;
}

int Evaluate(const EvaluateOptions& options) {
  StopSignals signals;
  const policy::LoadedPolicy loaded = policy::LoadPolicy(options.policy);
  const train::RunConfig config = TaskOf(options, loaded);
  const int threads = options.threads > 0
                          ? options.threads
                          : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  if (options.output) base::MakeDirectories(*options.output);
  base::ParallelFor parallel(threads);
  const auto result = EvaluatePolicy(loaded.snapshot, options.policy, config, options.courses,
                                     parallel, signals.token());
  if (!result) return kExitSignalBase + signals.received();
  if (options.json) {
    fmt::print("{}", eval::JsonReport(result->evaluation, result->provenance));
  } else {
    fmt::print("{}", eval::TextReport(result->evaluation));
  }
  if (options.output) {
    WriteEvaluation(*result, *options.output);
    if (!options.json) fmt::print("\nreports and pictures: {}/\n", *options.output);
  }
  return kExitOk;
}

}  // namespace

void AddEvaluateCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand("evaluate", "Score a policy on courses");
  command->footer(
      "Each course is driven --episodes times, from jittered starts and with sensor noise on "
      "random streams "
      "that\ntraining never uses (docs/evaluation.md). The task is the one the policy was trained "
      "for, unless "
      "--config or\n--set changes it; for example a lifelike drive:\n\n"
      "  slalom evaluate --policy runs/quickstart/policy.safetensors --courses static-test \\\n"
      "    --set environment.robot.linear_acceleration=4 --set "
      "environment.robot.command_delay=0.04\n");
  auto options = std::make_shared<EvaluateOptions>();
  command->add_option("--policy", options->policy, "Policy file (policy.safetensors)")->required();
  command
      ->add_option(
          "--courses", options->courses,
          "A set's name (slalom courses list), generated:SEED:COUNT, or a course or set file")
      ->required();
  command->add_option("--collection", options->collection,
                      "Directory of imported courses that set names refer to");
  command->add_option("--episodes", options->episodes, "Episodes per course [10]")
      ->check(CLI::Range(1, 100000));
  command->add_option("--seed", options->seed, "Root of the evaluation's random streams [1]")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{9'000'000'000'000'000}));
  command->add_option("--output", options->output,
                      "Directory for JSON, CSV, trajectories and pictures");
  command->add_flag("--json", options->json, "Print one JSON object instead of the table");
  command->add_option("--config", options->config,
                      "Take the task from this TOML file, not from the policy");
  command->add_option("--set", options->overrides, "Override a key: section.key=value (repeatable)")
      ->type_name("KEY=VALUE");
  command->add_option("--threads", options->threads, "Threads; changes the speed only [all]")
      ->check(CLI::Range(0, 256));
  command->callback([options, exit_code] { *exit_code = Evaluate(*options); });
}

}  // namespace slalom::cli
