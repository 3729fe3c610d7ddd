#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/cli/command_line.h"
#include "app/cli/commands.h"
#include "app/cli/signals.h"
#include "app/cli/training_results.h"
#include "app/train/begin_run.h"
#include "app/train/command_options.h"
#include "app/train/profile.h"
#include "app/train/run_limits.h"
#include "app/train/scoring.h"
#include "app/train/service_process.h"
#include "app/train/stage_trainer.h"
#include "app/train/trainer.h"
#include "base/config.h"
#include "base/error.h"
#include "base/exit_code.h"
#include "base/file.h"
#include "base/log.h"
#include "base/machine.h"
#include "base/progress.h"
#include "base/version.h"

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

constexpr char kRuns[] = "runs";           // Where runs lie without --output.
constexpr double kLargestUsualRate = 0.1;  // Higher learning rates cause a warning.

struct TrainOptions {
  std::string config;
  std::vector<std::string> profiles;
  std::vector<std::string> overrides;
  std::optional<std::string> name;
  std::optional<std::int64_t> seed;
  std::optional<std::string> from;
  std::optional<std::string> output;
  std::optional<std::string> metrics;
  bool resume = false;
  bool force = false;
  bool deterministic = false;
  bool no_evaluation = false;
};

/// The config file that the options name, and the run's directory if they name that, too.
struct Source {
  std::string config;
  std::optional<fs::path> run;
};

/// With --resume, CONFIG may be the run's directory or the config.toml in it, wherever the run lies
/// now; else the run is the one that CONFIG, --name and --output name.
Source FindSource(const TrainOptions& options) {
  const fs::path given = options.config;
  if (fs::is_directory(given)) {
    const run::RunDirectory directory{base::NormalisedDirectory(given)};
    base::ThrowIf(!options.resume,
                  "{}: is a directory, expected a TOML file; to go on with the run there: {}",
                  options.config, CommandLine({"train", directory.root.string(), "--resume"}));
    base::ThrowIf(!fs::exists(directory.config()),
                  "{}: there is no run to resume here, as config.toml is missing", options.config);
    return {directory.config().string(), directory.root};
  }
  const run::RunDirectory around{base::NormalisedDirectory(given.parent_path())};
  const bool is_of_run =
      given.filename() == around.config().filename() && fs::is_directory(around.checkpoints());
  if (options.resume && is_of_run && !options.name && !options.output) {
    return {options.config, around.root};
  }
  return {options.config, std::nullopt};
}

train::RunConfig LoadConfig(const TrainOptions& options, const Source& source) {
  const std::string& path = source.config;
  train::RunConfig config, defaults;
  const config::FieldList fields = config::ListFields(config);
  try {
    config::ReadTomlFile(path, fields);
  } catch (const base::Error&) {
    if (!config::HasSection(path, "sweep")) throw;
    throw base::Error(
        "{}: is the plan of a sweep, expected a config; work on it with: slalom sweep run {}", path,
        path);
  }
  if (source.run) config::ResetUnread(fields, config::ListFields(defaults));
  for (const std::string& file : options.profiles) {
    train::LayProfile(file, config.environment, config.guard);
  }
  for (const std::string& assignment : options.overrides) config::ApplyOverride(assignment, fields);
  if (options.name) config.run.name = *options.name;
  if (options.seed) config.run.seed = *options.seed;
  if (options.from) config.method.learner.from = *options.from;
  if (options.deterministic) config.run.deterministic = true;
  base::ThrowIf(config.run.name.empty() || config.run.name.find('/') != std::string::npos ||
                    config.run.name.starts_with('.'),
                "run.name is '{}', expected the name of a directory below {}/", config.run.name,
                options.output.value_or(kRuns));
  return config;
}

/// Step sizes that are allowed and hardly ever meant.
void WarnOfLearningRates(const learner::LearnerConfig& config) {
  const auto warn = [](const char* who, double rate) {
    if (rate > kLargestUsualRate) {
      spdlog::warn(
          "learner.{}_learning_rate is {}: Adam moves each weight by about this much in an update; "
          "usual values are 1e-5 to 1e-3",
          who, rate);
    } else if (rate == 0.0) {
      spdlog::warn("learner.{0}_learning_rate is 0: the {0} never changes", who);
    }
  };
  warn("actor", config.actor_learning_rate);
  warn("critic", config.critic_learning_rate);
}

/// The command that goes on with the run. Its own config holds every --set, --name and --seed that
/// it was begun with.
std::string ResumeCommand(const TrainOptions& options, const run::RunDirectory& directory,
                          const std::string& override = "") {
  std::string root = directory.root.string();
  if (root.starts_with('-')) root.insert(0, "./");
  std::vector<std::string> arguments = {"train", root, "--resume"};
  if (!override.empty()) arguments.insert(arguments.end(), {"--set", override});
  if (options.metrics) arguments.insert(arguments.end(), {"--metrics", *options.metrics});
  if (options.no_evaluation) arguments.emplace_back("--no-evaluation");
  return CommandLine(arguments);
}

/// The command that scores the policy and writes nothing to the run.
std::string EvaluateCommand(const run::RunDirectory& directory,
                            const train::CoursesConfig& courses) {
  std::vector<std::string> arguments = TestCoursesOptions(courses);
  arguments.insert(arguments.begin(), {"evaluate", "--policy", directory.policy().string()});
  return CommandLine(arguments);
}

/// Prints a line, or nothing if the terminal is gone.
void Print(const std::string& line) { std::fputs((line + "\n").c_str(), stdout); }

/// Whether the directory holds the scores of its policy. False if the overrides ask for other
/// scores.
bool IsScored(const TrainOptions& options, const run::RunDirectory& directory) {
  const bool asks_for_others = std::ranges::any_of(options.overrides, [](const std::string& set) {
    return set.starts_with("courses.test=") || set.starts_with("evaluation.");
  });
  const fs::path scores = directory.curve();  // Written last of them.
  return !asks_for_others && fs::exists(scores) &&
         fs::last_write_time(scores) >= fs::last_write_time(directory.policy());
}

/// The rule of output that exists, with what may be done about a run.
void RequireNoRun(const TrainOptions& options, const run::RunDirectory& directory) {
  if (options.resume || options.force || !fs::exists(directory.config())) return;
  throw base::Error(
      "{}: holds a run already; go on with it: {}; keep it and train another one with --name; or "
      "start over with --force, which moves it to {}.1 (.2, ...)",
      directory.root.string(), ResumeCommand(options, directory), directory.root.string());
}

/// Says why the run learned nothing and how to go on.
int FailToLearn(const TrainOptions& options, const run::RunDirectory& directory,
                const train::RunConfig& config, const train::Trainer& trainer) {
  if (trainer.updates() > 0) {
    const std::string fault = trainer.watch().fault();
    fmt::print(stderr,
               "slalom: nothing was learned: {}. No policy was kept; start a new run with "
               "other settings\n",
               fault.empty() ? "a network had no gradient when the run ended" : fault);
    return base::kExitLearnedNothing;
  }
  const auto why = train::ExplainNoUpdate(config, trainer.steps(), trainer.training_s());
  fmt::print(stderr, "slalom: nothing was learned: {}. To go on: {}\n", why.reason,
             ResumeCommand(options, directory, why.override));
  return base::kExitLearnedNothing;
}

int Score(const TrainOptions& options, const run::RunDirectory& directory,
          const train::RunConfig& config, const std::string& train_longer,
          const StopSignals& signals) {
  int exit_code = base::kExitError;
  try {
    base::ParallelFor parallel(base::NumProcessors());
    if (ScoreTraining(directory, config, train_longer, parallel, signals.token()))
      return base::kExitOk;
    exit_code = base::kExitSignalBase + signals.received();
  } catch (const base::Error& error) {
    fmt::print(stderr, "slalom: {}\n", error.what());
  }
  Print(fmt::format("the policy is trained but not scored: {}\nto score it: {}",
                    directory.policy().string(), ResumeCommand(options, directory)));
  return exit_code;
}

/// Reports on a run that reached its limit, and scores it if it is not scored yet.
int Finish(const TrainOptions& options, const run::RunDirectory& directory,
           const train::RunConfig& config, const train::Trainer& trainer, bool was_finished,
           const StopSignals& signals) {
  if (const std::string fault = trainer.watch().fault(); !fault.empty()) {
    spdlog::warn("the policy is probably of no use: {}", fault);
  }
  if (fs::exists(directory.metrics())) WriteTrainingPage(directory);
  const std::string longer =
      config.run.keep_checkpoints == run::KeepCheckpoints::kNone
          ? ""
          : ResumeCommand(options, directory,
                          train::LongerLimit(config, trainer.steps(), trainer.training_s()));
  const bool is_to_be_scored = !config.courses.test.empty() && !options.no_evaluation;
  if (was_finished && (!is_to_be_scored || IsScored(options, directory))) {
    Print(fmt::format("{} is finished: it has reached its limit, and nothing was changed",
                      directory.root.string()));
    if (!longer.empty()) Print("to go on: " + longer);
    return base::kExitOk;
  }
  if (is_to_be_scored) return Score(options, directory, config, longer, signals);
  Print("policy: " + directory.policy().string());
  return base::kExitOk;
}

int Train(const TrainOptions& options) {
  // So that a log shows each line when it was printed.
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  StopSignals signals;
  const Source source = FindSource(options);
  train::RunConfig loaded = LoadConfig(options, source);
  const run::RunDirectory directory{
      source.run.value_or(fs::path(options.output.value_or(kRuns)) / loaded.run.name)};
  if (options.resume) loaded.courses.inputs = directory.inputs();
  RequireNoRun(options, directory);
  train::ResolvedRun config =
      train::Resolve(loaded, {.drives = "slalom train", .begins = !options.resume});
  WarnOfLearningRates(config.method.learner);
  if (!options.no_evaluation && !config.courses.test.empty()) {
    // Fails now, not after the training, if the test courses are missing.
    train::WarnOfTrainingOverlap(config.courses.ResolveTest(), config);
  }
  spdlog::info("{} {}: training on {}, test on {}", options.resume ? "loading" : "preparing",
               directory.root.string(), config.courses.DescribeTrain(),
               config.courses.test.empty() ? "nothing" : config.courses.test);
  const std::string commit(base::Commit());
  const auto registry = std::make_shared<metrics::Registry>(
      train::MakeIdentity("train", config.run.name, config.run.name));
  const auto exposer = options.metrics ? train::ShowMetrics(*options.metrics, *registry) : nullptr;
  bool has_begun = options.resume;
  std::optional<run::RunLock> lock;
  if (!config.stages.empty()) {
    lock.emplace(train::BeginTraining(directory, config, options.resume));
    config.ReadCopies(directory.inputs());
    has_begun = true;
    switch (train::TrainStages(config, directory, commit, exposer.get(), signals.token())) {
      case train::TrainingEnd::kStopped:
        Print("stopped and saved; to go on: " + ResumeCommand(options, directory));
        return base::kExitSignalBase + signals.received();
      case train::TrainingEnd::kUnsaved:
        return base::kExitError;
      default:
        break;
    }
  }
  if (exposer) exposer->Show(registry);
  train::Trainer trainer(config, directory, commit, has_begun, *registry, run::TrainingClock(),
                         std::move(lock));
  config.courses.inputs = directory.inputs();
  const train::TrainingEnd end = trainer.Run(signals.token());
  if (end == train::TrainingEnd::kDiverged) return base::kExitDiverged;
  spdlog::info("trained for {}: {} steps, {} updates", base::FormatDuration(trainer.training_s()),
               base::FormatCount(static_cast<double>(trainer.steps())),
               base::FormatCount(static_cast<double>(trainer.updates())));
  if (end == train::TrainingEnd::kLearnedNothing) {
    return FailToLearn(options, directory, config, trainer);
  }
  if (end == train::TrainingEnd::kUnsaved) {
    WriteTrainingPage(directory);
    if (!config.courses.test.empty())
      Print("to score the policy: " + EvaluateCommand(directory, config.courses));
    return base::kExitError;
  }
  if (end == train::TrainingEnd::kStopped) {
    Print("stopped and saved; to go on: " + ResumeCommand(options, directory));
    return base::kExitSignalBase + signals.received();
  }
  return Finish(options, directory, config, trainer, end == train::TrainingEnd::kWasFinished,
                signals);
}

}  // namespace

void AddTrainCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand("train", "Train a policy in this process, then score it");
  command->footer(
      "Writes runs/NAME/: config, policy, metrics, checkpoints, scores and pictures "
      "(docs/operations.md).\n"
      "Ctrl-C saves and stops; --resume continues, also with the run's directory as CONFIG. "
      "Examples:\n\n"
      "  slalom train configs/quickstart.toml\n"
      "  slalom train configs/fast.toml --name mine --seed 2 --set run.max_seconds=60\n"
      "  slalom train runs/mine --resume --set run.max_seconds=120\n"
      "  slalom train configs/fast.toml --name more --from runs/mine/policy.safetensors\n");
  auto options = std::make_shared<TrainOptions>();
  command
      ->add_option("CONFIG", options->config,
                   "TOML file (configs/ has presets); with --resume, also a run's directory")
      ->required();
  command
      ->add_option("--profile", options->profiles,
                   "Lay the [environment] keys of this TOML file over the task (repeatable), for "
                   "example configs/real-robot.toml")
      ->type_name("FILE");
  command->add_option("--set", options->overrides, "Override a key: section.key=value (repeatable)")
      ->type_name("KEY=VALUE");
  command->add_option(train::kNameOption, options->name,
                      "Name of the run [run.name of the config]");
  command
      ->add_option("--seed", options->seed, "Seed of all random streams [run.seed of the config]")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{9'000'000'000'000'000}));
  command
      ->add_option("--from", options->from,
                   "Start from the weights of this policy [learner.from of the config]")
      ->type_name("POLICY");
  command->add_option(train::kOutputOption, options->output,
                      "Directory in which the run's directory is made [runs]");
  command
      ->add_option("--metrics", options->metrics,
                   "Address at which the training shows /metrics to Prometheus; port 0: any free "
                   "one [shown nowhere]")
      ->type_name("HOST:PORT");
  command->add_flag(train::kResumeOption, options->resume,
                    "Continue from the run's newest checkpoint");
  command->add_flag(train::kForceOption, options->force,
                    "Start over where a run exists, which is moved to NAME.1, NAME.2, ...");
  command->add_flag("--deterministic", options->deterministic,
                    "Use one thread, so that the same seed gives the same policy, bit for bit");
  command->add_flag(train::kNoEvaluationOption, options->no_evaluation,
                    "Do not score the policy at the end");
  command->callback([options, exit_code] { *exit_code = Train(*options); });
}

}  // namespace slalom::cli
