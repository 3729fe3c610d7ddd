#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "app/cli/command_line.h"
#include "app/cli/commands.h"
#include "app/cli/service_status.h"
#include "app/cli/signals.h"
#include "app/cli/status_table.h"
#include "app/cli/training_results.h"
#include "app/train/local_service.h"
#include "app/train/resolved_run.h"
#include "app/train/run_config.h"
#include "base/config.h"
#include "base/error.h"
#include "base/exit_code.h"
#include "base/file.h"
#include "base/file_lock.h"
#include "base/log.h"
#include "base/machine.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "learner/run/run_directory.h"

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::seconds;
using std::chrono::steady_clock;

constexpr milliseconds kLook{200};      // At the processes.
constexpr milliseconds kPatience{500};  // With a replay server that is asked for the table.
constexpr seconds kRedraw{2};           // On a terminal.
constexpr seconds kFirstTable{10};      // Elsewhere, and
constexpr seconds kNextTable{60};

struct Options {
  std::string config;
  std::vector<std::string> overrides;
  int actors = 1;
  int replay_servers = 1;
  bool evaluator = false;
};

/// The table of a service's processes: on a terminal it is drawn again in its place, elsewhere it
/// is printed once a minute.
class Table {
 public:
  void Show(const std::string& text) {
    if (!terminal_) {
      fmt::print("{}", text);
      return;
    }
    const std::size_t width = base::TerminalColumns(stdout) - 1;
    if (num_lines_ > 0) fmt::print("\x1b[{}F\x1b[J", num_lines_);
    num_lines_ = 0;
    for (std::size_t begin = 0; begin < text.size();) {
      const std::size_t end = std::min(text.find('\n', begin), text.size());
      fmt::print("{}\n", std::string_view(text).substr(begin, std::min(end - begin, width)));
      begin = end + 1;
      ++num_lines_;
    }
  }

  /// Other lines were printed below it, so the next one stands below them.
  void Leave() { num_lines_ = 0; }

  steady_clock::duration interval() const { return terminal_ ? kRedraw : kNextTable; }

 private:
  const bool terminal_ = ::isatty(STDOUT_FILENO) == 1;
  int num_lines_ = 0;
};

/// Looks after the service until it ends, and shows its table. Returns the learner's exit code.
int Attend(train::LocalService& service, const StopSignals& signals) {
  Table table;
  auto next_table =
      steady_clock::now() + std::min<steady_clock::duration>(table.interval(), kFirstTable);
  bool stops = false;
  for (int num_restarts = 0;;) {
    if (signals.received() != 0 && !stops) {
      stops = true;
      service.Signal(SIGTERM);
    }
    if (const auto exit_code = service.Wait(kLook)) return *exit_code;
    if (std::exchange(num_restarts, service.num_restarts()) != num_restarts) table.Leave();
    if (stops || steady_clock::now() < next_table) continue;
    try {
      table.Show(FormatStatus(AskStatus(service.config(), kPatience)));
    } catch (const base::Error&) {  // The replay server comes, or its log says why not.
    }
    next_table = steady_clock::now() + table.interval();
  }
}

std::string StartCommand(const Options& options) {
  std::vector<std::string> arguments = {"service", options.config, "--actors",
                                        std::to_string(options.actors)};
  if (options.replay_servers > 1) {
    arguments.insert(arguments.end(), {"--replay-servers", std::to_string(options.replay_servers)});
  }
  if (options.evaluator) arguments.emplace_back("--evaluator");
  for (const std::string& assignment : options.overrides) {
    arguments.insert(arguments.end(), {"--set", assignment});
  }
  return CommandLine(arguments);
}

int Run(const Options& options) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  StopSignals signals;
  const auto loaded = config::Load<train::RunConfig>(options.config, options.overrides);
  const fs::path state = loaded.service.state;
  const run::RunDirectory directory{state / "learner"};
  const train::RunConfig config = train::Resolve(
      loaded,
      {.drives = "slalom service", .begins = !base::Exists(directory.config()), .serves = true});
  base::MakeDirectories(state);
  const auto lock = base::FileLock::OfFile(state / "service.lock",
                                           "another `slalom service` works on this state");
  int exit_code = base::kExitOk;
  {
    train::LocalService service({.program = fmt::format("/proc/{}/exe", ::getpid()),
                                 .config = config,
                                 .num_actors = options.actors,
                                 .num_replay_servers = options.replay_servers,
                                 .evaluator = options.evaluator,
                                 .directory = state,
                                 .run = directory.root});
    spdlog::info("{}replay server{}, learner, {} actor{}{}: their logs are {}/*.log",
                 options.replay_servers == 1 ? "" : fmt::format("{} ", options.replay_servers),
                 options.replay_servers == 1 ? "" : "s", options.actors,
                 options.actors == 1 ? "" : "s", options.evaluator ? ", evaluator" : "",
                 (state / "logs").string());
    spdlog::info("from another terminal: {}",
                 CommandLine({"status", "--config", (state / "service.toml").string()}));
    spdlog::info("curves and drives: {}", CommandLine({"watch", directory.root.string()}));
    exit_code = Attend(service, signals);
    if (!service.fault().empty()) throw base::Error("{}", service.fault());
  }
  if (signals.received() != 0) {
    fmt::print("stopped and saved; to go on: {}\n", StartCommand(options));
    return base::kExitSignalBase + signals.received();
  }
  if (exit_code != base::kExitOk) {
    fmt::print(stderr, "slalom: the training failed; {} says why\n",
               (state / "logs/learner.log").string());
    return exit_code;
  }
  if (config.courses.test.empty()) {
    fmt::print("policy: {}\n", directory.policy().string());
    return base::kExitOk;
  }
  base::ParallelFor parallel(base::NumProcessors());
  train::RunConfig with_copies = config;
  with_copies.courses.inputs = directory.inputs();
  if (ScoreTraining(directory, with_copies, "", parallel, signals.token())) return base::kExitOk;
  fmt::print("the policy is trained but not scored: {}\nto score it: {}\n",
             directory.policy().string(), StartCommand(options));
  return base::kExitSignalBase + signals.received();
}

}  // namespace

void AddLocalServiceCommand(CLI::App& app, int* exit_code) {
  CLI::App* command = app.add_subcommand(
      "service",
      "Train by a service whose processes all run on this machine, then score the policy");
  auto options = std::make_shared<Options>();
  options->actors = std::max(1, base::NumProcessors() - 1);
  command->add_option("CONFIG", options->config, "TOML file, such as configs/cluster.toml")
      ->required();
  command->add_option("--actors", options->actors, "Actors beside replay server and learner")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command
      ->add_option("--replay-servers", options->replay_servers,
                   "Replay servers, which share the rows and the work")
      ->check(CLI::Range(1, 16))
      ->capture_default_str();
  command->add_flag("--evaluator", options->evaluator,
                    "Score the learner's policies meanwhile, on evaluator_service.courses");
  command->add_option("--set", options->overrides, "Override a key: section.key=value (repeatable)")
      ->type_name("KEY=VALUE");
  command->footer(
      "The processes meet at addresses of this machine, by keys of their own, whatever [service]\n"
      "and [security] say. All files lie below service.state. SIGINT, SIGTERM or SIGHUP saves and\n"
      "ends everything; the same command goes on. A process that dies is started again. Ends when\n"
      "the training ends (run.max_steps, run.max_seconds).");
  command->callback([options, exit_code] { *exit_code = Run(*options); });
}

}  // namespace slalom::cli
