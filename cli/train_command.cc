#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "base/progress.h"
#include "cli/commands.h"
#include "cli/evaluate_policy.h"
#include "cli/process_start.h"
#include "cli/signals.h"
#include "cli/training_overlap.h"
#include "cli/training_results.h"
#include "cli/version.h"
#include "config/config.h"
#include "sim/course_sets.h"
#include "train/trainer.h"

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

struct TrainOptions {
  std::string config;
  std::vector<std::string> overrides;
  std::optional<std::string> name;
  std::optional<std::int64_t> seed;
  std::string output = "runs";
  bool resume = false;
  bool deterministic = false;
  bool no_evaluation = false;
};

train::RunConfig LoadConfig(const TrainOptions& options) {
  auto config = config::Load<train::RunConfig>(options.config, options.overrides);
  if (options.name) config.run.name = *options.name;
  if (options.seed) config.run.seed = *options.seed;
  if (options.deterministic) config.run.deterministic = true;
  if (config.run.name.empty() || config.run.name.find('/') != std::string::npos ||
      config.run.name.starts_with('.')) {
    throw base::Error(fmt::format("run.name is '{}', expected the name of a directory below {}/",
                                  config.run.name, options.output));
  }
  return config;
}

/// Says before the training, and not after, that it could not be scored.
void CheckTestCourses(const train::CoursesConfig& courses) {
  const auto built_in = sim::ListCourseSets(std::nullopt);
  const bool is_built_in = courses.collection.empty() && std::find(built_in.begin(), built_in.end(),
                                                                   courses.test) != built_in.end();
  if (courses.test.empty() || is_built_in) return;
  courses.ResolveTest();
}

/// The run's own config holds every --set, --name and --seed that it was begun with.
std::string ResumeCommand(const TrainOptions& options, const run::RunDirectory& directory) {
  const std::string output = options.output == "runs" ? "" : " --output " + options.output;
  return fmt::format("./slalom train {}{} --resume", directory.config().string(), output);
}

int Train(const TrainOptions& options) {
  StopSignals signals;
  const train::RunConfig config = LoadConfig(options);
  const run::RunDirectory directory{fs::path(options.output) / config.run.name};
  if (!options.no_evaluation) CheckTestCourses(config.courses);
  if (!options.no_evaluation && !config.courses.test.empty()) {
    WarnOfTrainingOverlap(config.courses.ResolveTest(), config.courses);
  }
  train::Trainer trainer(config, directory, std::string(Commit()), options.resume, ProcessStart());
  spdlog::info("training on {}, test on {}, run directory {}", config.courses.train,
               config.courses.test.empty() ? "nothing" : config.courses.test,
               directory.root.string());
  const train::TrainingEnd end = trainer.Run(signals.token());
  if (end == train::TrainingEnd::kDiverged) return kExitDiverged;
  spdlog::info("trained for {}: {} steps, {} updates", base::FormatDuration(trainer.training_s()),
               base::FormatCount(static_cast<double>(trainer.steps())),
               base::FormatCount(static_cast<double>(trainer.updates())));
  if (trainer.updates() == 0) {
    spdlog::warn(
        "nothing was learned: run.learning_starts is {}, the replay holds at most "
        "replay.capacity = {} steps",
        config.run.learning_starts, config.replay.capacity);
  }
  if (end == train::TrainingEnd::kStopped) {
    fmt::print("stopped and saved; to go on: {}\n", ResumeCommand(options, directory));
    return kExitSignalBase + signals.received();
  }
  DrawTraining(directory);
  if (config.courses.test.empty() || options.no_evaluation) {
    fmt::print("policy: {}\n", directory.policy().string());
    return kExitOk;
  }
  base::ParallelFor parallel(std::max(1, static_cast<int>(std::thread::hardware_concurrency())));
  if (!ScoreTraining(directory, config, parallel, signals.token())) {
    fmt::print("the policy is trained but not scored: {}\nto score it: {}\n",
               directory.policy().string(), ResumeCommand(options, directory));
    return kExitSignalBase + signals.received();
  }
  return kExitOk;
}

}  // namespace

void AddTrainCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand("train", "Train a policy in this process, then score it");
  command->footer(
      "Writes runs/NAME/: config, policy, metrics, checkpoints, scores and pictures "
      "(docs/operations.md).\n"
      "Ctrl-C saves and stops; --resume goes on. Examples:\n\n"
      "  slalom train configs/quickstart.toml\n"
      "  slalom train configs/fast.toml --name mine --seed 2 --set run.max_seconds=60\n"
      "  slalom train configs/paper/td3-mlp.toml --resume\n");
  auto options = std::make_shared<TrainOptions>();
  command->add_option("CONFIG", options->config, "TOML file; configs/ has presets")->required();
  command->add_option("--set", options->overrides, "Override a key: section.key=value (repeatable)")
      ->type_name("KEY=VALUE");
  command->add_option("--name", options->name, "Name of the run [run.name of the config]");
  command
      ->add_option("--seed", options->seed, "Root of all random streams [run.seed of the config]")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{9'000'000'000'000'000}));
  command->add_option("--output", options->output, "Directory that holds runs [runs]");
  command->add_flag("--resume", options->resume, "Go on from the run's newest checkpoint");
  command->add_flag("--deterministic", options->deterministic,
                    "One thread in lockstep: the same seed gives the same policy, bit for bit");
  command->add_flag("--no-evaluation", options->no_evaluation,
                    "Do not score the policy at the end");
  command->callback([options, exit_code] { *exit_code = Train(*options); });
}

}  // namespace slalom::cli
