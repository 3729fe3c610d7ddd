#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "app/cli/command_line.h"
#include "app/cli/commands.h"
#include "app/cli/signals.h"
#include "app/cli/sweep_selection.h"
#include "app/sweep/cell.h"
#include "app/sweep/cell_archive.h"
#include "app/sweep/estimate.h"
#include "app/sweep/plan.h"
#include "app/sweep/report/report.h"
#include "app/sweep/runner.h"
#include "app/sweep/slurm.h"
#include "app/sweep/store.h"
#include "app/sweep/sweep_metrics.h"
#include "app/train/command_options.h"
#include "app/train/resolved_run.h"
#include "app/train/run_identity.h"
#include "base/child_process.h"
#include "base/error.h"
#include "base/exit_code.h"
#include "base/file.h"
#include "base/log.h"
#include "base/machine.h"
#include "base/mutex.h"
#include "base/progress.h"
#include "base/version.h"
#include "metrics/exposer.h"
#include "sim/engines/physics.h"

namespace slalom::cli {
namespace {

namespace fs = std::filesystem;

/// Default address at which `slalom sweep serve` shows metrics.
constexpr char kSweepMetricsAddress[] = "127.0.0.1:9420";

metrics::Identity ThisProcess() {
  metrics::Identity identity;
  identity.name = base::HostName();
  identity.version = base::Version();
  identity.commit = base::Commit();
  return identity;
}

/// Calls `act` again and again, with `SweepMetrics::kInterval` between the calls, until a stop is
/// requested.
template <class Act>
void RepeatUntilStop(const std::stop_token& stop, const Act& act) {
  base::Mutex mutex;
  base::CondVar changed;
  const std::stop_callback wake(stop, [&] {
    const base::MutexLock lock(mutex);
    changed.NotifyAll();
  });
  const base::MutexLock lock(mutex);
  while (!stop.stop_requested()) {
    act();
    changed.WaitFor(mutex, sweep::SweepMetrics::kInterval);
  }
}

/// Shows the metrics of a sweep (`sweep::SweepMetrics`) for as long as it exists, and keeps them up
/// to date in a thread of its own. Works on no cell and writes nothing, so any number of them may
/// show the same sweep, even before its store exists.
class SweepExposer {
 public:
  /// `address`: as for `metrics::Exposer`, with its errors. Prints the address of the metrics.
  SweepExposer(const sweep::Plan& plan, const sweep::Cells& cells, const fs::path& store,
               const std::string& address)
      : metrics_(plan, cells, store, ThisProcess()),
        exposer_(address, metrics_.registry()),
        thread_(base::StartThread("the metrics of a sweep", [this](const std::stop_token& stop) {
          RepeatUntilStop(stop, [this] { metrics_.Update(); });
        })) {
    fmt::print("sweep {}: metrics at http://{}:{}/metrics\n", plan.sweep.name,
               address.substr(0, address.rfind(':')), exposer_.port());
    std::fflush(stdout);
  }

 private:
  sweep::SweepMetrics metrics_;
  const metrics::Exposer exposer_;
  std::jthread thread_;
};

/// Shows the metrics until SIGINT, SIGTERM or SIGHUP. Returns the exit code. Throws `base::Error`
/// if the address cannot be listened on.
int ServeSweep(const sweep::Plan& plan, const sweep::Cells& cells, const fs::path& store,
               const std::string& address) {
  StopSignals signals;
  const SweepExposer exposer(plan, cells, store, address);
  signals.Wait();
  return base::kExitOk;
}

fs::path Program() { return fs::read_symlink("/proc/self/exe"); }

std::int64_t DiskNeeded(const std::vector<sweep::Cell>& cells, const fs::path& store, int at_once) {
  std::vector<std::int64_t> training;
  std::int64_t kept = 0;
  for (const sweep::Cell& cell : cells) {
    if (sweep::IsDone(store, cell)) continue;
    training.push_back(sweep::BytesWhileTraining(cell));
    kept += sweep::BytesKept(cell);
  }
  std::ranges::sort(training, std::greater());
  training.resize(std::min(training.size(), static_cast<std::size_t>(at_once)));
  for (const std::int64_t bytes : training) kept += bytes;
  return kept;
}

/// Why a cell that was finished elsewhere is not done here, for its line in a list.
std::string Remark(const sweep::Cell& cell, const fs::path& store) {
  const bool trains_again = !sweep::IsDone(store, cell) && sweep::LacksPolicy(store, cell);
  return trains_again ? ": trained again for a score, as its policy is not here" : "";
}

/// Throws `base::Error` if the disk is too small for the remaining work.
void RequireDisk(const std::vector<sweep::Cell>& cells, const fs::path& store, int at_once) {
  const std::int64_t needed = DiskNeeded(cells, store, at_once);
  const auto available = static_cast<std::int64_t>(fs::space(store).available);
  if (needed <= available) return;
  throw base::Error(
      "{}: the sweep needs about {} here and {} are available; run fewer cells at once (--at-once) "
      "or choose another place (--output)",
      store.string(), base::FormatBytes(static_cast<double>(needed)),
      base::FormatBytes(static_cast<double>(available)));
}

/// Throws `base::Error` if this program was built without a physics engine that a missing score is
/// driven in.
void RequirePhysics(const std::vector<sweep::Cell>& cells, const SweepOptions& options) {
  for (const sweep::Cell& cell : cells) {
    for (const sweep::ScoreTask& task : cell.scores) {
      if (sweep::IsScored(options.store, cell, task)) continue;
      try {
        (void)engines::FindPhysics(task.physics);
      } catch (const base::Error& error) {
        throw base::Error("{}: score '{}': {}", options.plan, task.name, error.what());
      }
    }
  }
}

/// Returns the time left with this machine's cores, [s]; none: not known.
std::optional<double> PrintPlan(const SweepOptions& options) {
  const Sweep sweep = LoadSweep(options);
  const sweep::Slots slots =
      sweep::ShareOut(base::AvailableCores(), options.at_once, sweep.plan.sweep.lockstep);
  fmt::print("{}: {}\n\n", sweep.plan.sweep.name, sweep.plan.sweep.title);
  fmt::print("{:<17} {:<9} {:>12} {:>7}  {}\n", "cell", "state", "steps", "scores", "what");
  sweep::Rates rates;
  int num_done = 0;
  for (const sweep::Cell& cell : sweep.chosen) {
    const sweep::CellStatus status = sweep::ReadCellStatus(options.store, cell);
    rates.Observe(cell, status);
    num_done += status.state == sweep::CellState::kDone ? 1 : 0;
    const std::string steps =
        cell.config ? fmt::format("{}", train::MaxStepsOf(*cell.config)) : "-";
    fmt::print("{:<17} {:<9} {:>12} {:>7}  {}{}\n", cell.id, sweep::ToString(status.state), steps,
               cell.scores.size(), cell.name(), Remark(cell, options.store));
  }
  fmt::print("\n{} cells, {} done", sweep.chosen.size(), num_done);
  const int num_stale = sweep::CountStale(options.store, sweep.plan, sweep.all);
  if (num_stale > 0) {
    fmt::print(
        "; {} cells of the plan's last run are stale: they stay in {}/cells and no longer "
        "count",
        num_stale, options.store);
  }
  fmt::print("\ndisk: about {}\n", base::FormatBytes(static_cast<double>(
                                       DiskNeeded(sweep.chosen, options.store, slots.at_once))));
  double left_s = 0.0;
  int num_left = 0;
  for (const sweep::Cell& cell : sweep.chosen) {
    const sweep::CellStatus status = sweep::ReadCellStatus(options.store, cell);
    if (status.state == sweep::CellState::kDone) continue;
    ++num_left;
    if (cell.config && cell.config->run.max_seconds == 0.0 && !rates.knows(cell.group)) {
      if (options.no_trial) {
        fmt::print(
            "time: not known, as nothing like '{}' was trained here; without --no-trial it "
            "is measured\n",
            cell.name());
        return std::nullopt;
      }
      spdlog::info("measuring how fast '{}' trains", cell.name());
      const auto seconds = sweep::MeasureSecondsPerStep(cell, Program());
      if (!seconds) {
        fmt::print("time: not known, as '{}' made no update in a short trial\n", cell.name());
        return std::nullopt;
      }
      rates.Set(cell.group, *seconds);
    }
    left_s += rates.SecondsLeft(cell, status.steps, status.num_scores_done).value_or(0.0);
  }
  const double wall_s = sweep::WallSeconds(left_s, num_left, slots.at_once);
  fmt::print("time: about {} with {} at once on this machine{}\n", base::FormatDuration(wall_s),
             slots.at_once,
             rates.knows_scores() ? "" : ", and the scores, which were never timed here");
  return wall_s;
}

/// Prints every plan that the options ask for, and the time that they take together.
void PrintPlans(const SweepOptions& options) {
  const std::vector<SweepOptions> each = EachPlan(options);
  std::optional<double> wall_s = 0.0;
  for (const SweepOptions& one : each) {
    const std::optional<double> left_s = PrintPlan(one);
    if (wall_s) wall_s = left_s ? std::optional(*wall_s + *left_s) : std::nullopt;
    if (each.size() > 1) fmt::print("\n");
  }
  if (each.size() == 1) return;
  fmt::print("{}: {} plans, {}\n", options.plan, each.size(),
             wall_s ? "about " + base::FormatDuration(*wall_s) : "time not known");
}

/// Directory for the files that a sweep exchanges with Slurm.
fs::path SlurmDirectory(const SweepOptions& options, const Sweep& sweep) {
  return sweep::PlanDirectory(options.store, sweep.plan.sweep.name) / "slurm";
}

/// Prints the states of the cells' tasks in Slurm, if any were submitted.
void PrintSlurmStatus(const SweepOptions& options, const Sweep& sweep) {
  const sweep::SlurmStatus status =
      sweep::ReadSlurmStatus(SlurmDirectory(options, sweep), sweep.plan.sweep.name);
  if (status.tasks.empty()) return;
  fmt::print("\n{:<17} {:<12} {:<13} {}\n", "cell", "Slurm's task", "state", "output");
  for (const sweep::SlurmTask& task : status.tasks) {
    if (std::ranges::find(sweep.chosen, task.cell, &sweep::Cell::id) == sweep.chosen.end()) {
      continue;
    }
    fmt::print("{:<17} {:<12} {:<13} {}{}\n", task.cell, task.task,
               task.state.empty() ? "ended" : task.state, task.output.string(),
               task.reason.empty() ? "" : " (" + task.reason + ")");
  }
  for (const std::string& note : status.notes) fmt::print("{}\n", note);
}

void PrintStatus(const SweepOptions& options) {
  const Sweep sweep = LoadSweep(options);
  std::map<sweep::CellState, int> counts;
  fmt::print("{:<17} {:<9} {:>12} {:>7}  {}\n", "cell", "state", "steps", "scores", "what");
  for (const sweep::Cell& cell : sweep.chosen) {
    const sweep::CellStatus status = sweep::ReadCellStatus(options.store, cell);
    ++counts[status.state];
    fmt::print("{:<17} {:<9} {:>12} {:>3} / {:<1}  {}{}\n", cell.id, sweep::ToString(status.state),
               status.steps, status.num_scores_done, cell.scores.size(), cell.name(),
               status.failure ? ": " + status.failure->what : Remark(cell, options.store));
  }
  std::vector<std::string> texts;
  texts.reserve(counts.size());
  for (const auto& [state, count] : counts) {
    texts.push_back(fmt::format("{} {}", count, sweep::ToString(state)));
  }
  fmt::print("\n{} cells: {}\n", sweep.chosen.size(), fmt::join(texts, ", "));
  PrintSlurmStatus(options, sweep);
}

/// The command that goes on with the sweep.
std::string ResumeCommand(const SweepOptions& options, const std::string& more = "") {
  std::vector<std::string> arguments = {"sweep", "run",
                                        options.list.empty() ? options.plan : options.list};
  for (const std::string& set : options.overrides) {
    arguments.insert(arguments.end(), {"--set", set});
  }
  const auto add = [&arguments](const std::string& key, const std::string& value) {
    arguments.insert(arguments.end(), {key, value});
  };
  if (options.store != kSweepStore) add("--output", options.store);
  for (const std::string& group : options.groups) add("--only", group);
  for (const std::string& id : options.ids) add("--cell", id);
  if (!options.shard.empty()) add("--shard", options.shard);
  if (options.at_once > 0) add("--at-once", std::to_string(options.at_once));
  if (options.threads > 0) add("--threads", std::to_string(options.threads));
  if (!options.metrics.empty()) add("--metrics", options.metrics);
  if (!more.empty()) arguments.push_back(more);
  return CommandLine(arguments);
}

/// Submits the cells that are neither done nor given up, and returns at once.
void SubmitSweep(const SweepOptions& options, const Sweep& sweep) {
  std::vector<std::string> left;
  for (const sweep::Cell& cell : sweep.chosen) {
    const sweep::CellState state = sweep::ReadCellStatus(options.store, cell).state;
    if (state != sweep::CellState::kDone && state != sweep::CellState::kFailed) {
      left.push_back(cell.id);
    }
  }
  std::vector<std::string> command = {Program().string(), "sweep", "run", options.plan};
  for (const std::string& set : options.overrides) command.insert(command.end(), {"--set", set});
  command.insert(command.end(), {"--output", options.store, "--at-once", "1", "--threads", "1"});
  const sweep::SlurmSubmission submission = sweep::SubmitToSlurm(
      {sweep.plan.sweep.name, sweep.plan.slurm, command, SlurmDirectory(options, sweep)}, left);
  fmt::print("{}: {} of {} cells are done or failed, {} are in Slurm already, {} are submitted{}\n",
             sweep.plan.sweep.name, sweep.chosen.size() - left.size(), sweep.chosen.size(),
             submission.num_queued, submission.num_submitted,
             submission.job.empty() ? "" : " as array " + submission.job);
}

/// Writes a plan's report while its cells are worked on, now and then.
class Reporter {
 public:
  Reporter(const Sweep& sweep, fs::path store) : sweep_(sweep), store_(std::move(store)) {}

  /// Writes it if some time has passed since. A disk that is full does not end the sweep.
  void Update() {
    if (last_ && Clock::now() - *last_ < kInterval) return;
    try {
      Write();
    } catch (const base::Error& error) {
      spdlog::warn("the report is not written: {}", error.what());
    }
    last_ = Clock::now();
  }

  /// Writes the report, and returns its content, which refers to the sweep.
  sweep::ReportContent Write() const {
    sweep::ReportContent content = sweep::MakeContent(sweep_.plan, sweep_.all, store_);
    sweep::WriteSweepReport(content, store_);
    return content;
  }

  /// The table of the scores, and the paths of the report.
  std::string Summary(const sweep::ReportContent& content) const {
    const fs::path page = sweep::PlanDirectory(store_, sweep_.plan.sweep.name) / "report.html";
    return fmt::format("{}\nreport: {}, and report.md and .csv beside it\n",
                       sweep::SweepSummary(content), page.string());
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kInterval{20};

  const Sweep& sweep_;
  const fs::path store_;
  std::optional<Clock::time_point> last_;
};

int RunSweep(const SweepOptions& options, const Sweep& sweep) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  StopSignals signals;
  base::MakeDirectories(options.store);
  sweep::RequireSharable(options.store);
  sweep::Slots slots =
      sweep::ShareOut(base::AvailableCores(), options.at_once, sweep.plan.sweep.lockstep);
  if (options.threads > 0 && options.threads != slots.threads) {
    slots.threads = options.threads;
    slots.pinned = false;
  }
  RequirePhysics(sweep.chosen, options);
  RequireDisk(sweep.chosen, options.store, slots.at_once);
  const train::Platform platform = train::ThisPlatform();
  sweep::BeginPlan(options.store, sweep.plan, sweep.all, platform, std::string(base::Commit()));
  if (options.retry_failed) {
    for (const sweep::Cell& cell : sweep.chosen) {
      std::error_code ec;
      fs::remove(sweep::CellDirectory(options.store, cell.id).failed(), ec);
    }
  }
  if (options.engine == "slurm") {
    SubmitSweep(options, sweep);
    return base::kExitOk;
  }
  const sweep::SweepSettings& settings = sweep.plan.sweep;
  spdlog::info("{}: {} cells in {}, {} at once, {}", settings.name, sweep.chosen.size(),
               options.store, slots.at_once,
               settings.trainer == sweep::Trainer::kService
                   ? fmt::format("by services of {} actors", settings.actors)
               : settings.lockstep ? "in lockstep"
                                   : "with threads");
  std::optional<SweepExposer> exposer;
  if (!options.metrics.empty()) {
    exposer.emplace(sweep.plan, sweep.all, options.store, options.metrics);
  }
  const sweep::WorkOptions work = {.store = options.store,
                                   // The file that runs, also once a newer one lies at its path.
                                   .program = fmt::format("/proc/{}/exe", ::getpid()),
                                   .commit = std::string(base::Commit()),
                                   .platform = train::Describe(platform)};
  Reporter reporter(sweep, options.store);
  const sweep::SweepEnd end = sweep::RunCells(sweep.chosen, work, slots, signals.token(),
                                              [&reporter] { reporter.Update(); });
  const sweep::ReportContent content = reporter.Write();
  if (end.stopped) {
    fmt::print("stopped: {} of {} cells are done; to go on: {}\n", end.num_done,
               sweep.chosen.size(), ResumeCommand(options));
    return base::kExitSignalBase + signals.received();
  }
  fmt::print("\n{}", reporter.Summary(content));
  if (end.num_failed > 0) {
    fmt::print(stderr, "slalom: {} of {} cells failed; to try them again: {}\n", end.num_failed,
               sweep.chosen.size(), ResumeCommand(options, "--retry-failed"));
    return base::kExitError;
  }
  return base::kExitOk;
}

/// The sweeps of all plans, so that a mistake in the last one shows before the first one runs.
std::vector<Sweep> LoadSweeps(const std::vector<SweepOptions>& each) {
  std::vector<Sweep> sweeps;
  sweeps.reserve(each.size());
  for (const SweepOptions& one : each) sweeps.push_back(LoadSweep(one));
  return sweeps;
}

/// Works on every plan that the options ask for, unless a signal says to stop.
int RunSweeps(const SweepOptions& options) {
  int exit_code = base::kExitOk;
  const std::vector<SweepOptions> each = EachPlan(options);
  const std::vector<Sweep> sweeps = LoadSweeps(each);
  for (std::size_t i = 0; i < each.size(); ++i) {
    const int code = RunSweep(each[i], sweeps[i]);
    if (code >= base::kExitSignalBase) return code;
    if (code != base::kExitOk) exit_code = code;
  }
  return exit_code;
}

/// Writes the report of every plan that the options ask for, and their tables into the pages.
void WriteReports(const SweepOptions& options) {
  const std::vector<Sweep> sweeps = LoadSweeps(EachPlan(options));
  std::vector<sweep::ReportContent> contents;
  contents.reserve(sweeps.size());
  for (const Sweep& sweep : sweeps) {
    const Reporter reporter(sweep, options.store);
    contents.push_back(reporter.Write());
    fmt::print("{}", reporter.Summary(contents.back()));
  }
  for (const std::string& page : options.pages) {
    base::WriteFileAtomically(page, sweep::FillBlocks(base::ReadFile(page), page, contents));
  }
}

}  // namespace

void AddSweepCommand(CLI::App& app, int* exit_code) {
  CLI::App* sweep = app.add_subcommand(
      "sweep", "Train and score many settings and seeds from one plan, and compare them");
  sweep->require_subcommand(1);
  auto options = std::make_shared<SweepOptions>();

  CLI::App* plan = sweep->add_subcommand(
      "plan", "Print the cells of a plan, with the time and disk that they take");
  AddPlanOptions(*plan, *options);
  plan->add_flag("--no-trial", options->no_trial,
                 "Do not measure the speed of trainings that were never run here");
  plan->callback([options] { PrintPlans(*options); });

  CLI::App* run = sweep->add_subcommand(
      "run", "Work on a plan's cells until all are done; start it again to go on");
  AddPlanOptions(*run, *options);
  run->add_flag("--retry-failed", options->retry_failed, "Try cells again that have failed");
  run->add_option("--metrics", options->metrics,
                  "Show the cells to Prometheus meanwhile, at this HOST:PORT, as `serve` does");
  run->add_option("--threads", options->threads, "Threads for each cell [its share of the cores]")
      ->check(CLI::Range(0, train::kMaxThreads));
  run->add_option("--engine", options->engine,
                  "Who runs the cells: local, this machine; slurm, a job array of a Slurm cluster "
                  "(docs/sweeps-cluster.md) [local]")
      ->check(CLI::IsMember({"local", "slurm"}));
  run->callback([options, exit_code] { *exit_code = RunSweeps(*options); });

  CLI::App* status = sweep->add_subcommand("status", "Print the state of a plan's cells");
  AddPlanOptions(*status, *options);
  status->callback([options] {
    for (const SweepOptions& one : EachPlan(*options)) PrintStatus(one);
  });

  CLI::App* report =
      sweep->add_subcommand("report", "Write the report of a plan's cells, done or not");
  AddPlanOptions(*report, *options);
  report
      ->add_option("--into", options->pages,
                   "Also fill the tables of this Markdown page (docs/sweeps.md; repeatable)")
      ->check(CLI::ExistingFile);
  report->callback([options] { WriteReports(*options); });

  CLI::App* export_cells = sweep->add_subcommand(
      "export", "Copy the results of a plan's done cells, without policies, into an archive");
  AddPlanOptions(*export_cells, *options);
  export_cells
      ->add_option("--to", options->archive, "Archive of the copies, such as cells.jsonl.xz")
      ->required();
  export_cells->callback([options] {
    for (const SweepOptions& one : EachPlan(*options)) {
      const Sweep loaded = LoadSweep(one);
      const sweep::Copied copied = sweep::ExportCells(one.store, loaded.chosen, one.archive);
      fmt::print("{}: {} cells are new in {}, {} were there, {} are not done\n",
                 loaded.plan.sweep.name, copied.num_new, one.archive, copied.num_same,
                 copied.num_left);
    }
  });

  CLI::App* import_cells = sweep->add_subcommand(
      "import", "Take up results that `sweep export` wrote, so that their cells are done here");
  import_cells->add_option("ARCHIVE", options->archive, "File that `sweep export` wrote")
      ->required();
  import_cells->add_option("--output", options->store,
                           "Directory of all sweeps, which share their cells [runs/sweeps]");
  import_cells->callback([options] {
    const sweep::Copied copied = sweep::ImportCells(options->archive, options->store);
    fmt::print("{}: {} cells are new, {} were there, {} are being worked on and left alone\n",
               options->store, copied.num_new, copied.num_same, copied.num_busy);
  });

  CLI::App* serve = sweep->add_subcommand(
      "serve", "Show a plan's cells to Prometheus while others work on them (docs/operations.md)");
  AddPlanOptions(*serve, *options);
  serve->add_option(
      "--metrics", options->metrics,
      fmt::format("Address of /metrics; port 0: any free one [{}]", kSweepMetricsAddress));
  serve->callback([options, exit_code] {
    const Sweep loaded = LoadSweep(*options);
    *exit_code = ServeSweep(loaded.plan, {loaded.chosen, loaded.all.axis_names}, options->store,
                            options->metrics.empty() ? kSweepMetricsAddress : options->metrics);
  });

  sweep->footer(
      "A plan names a preset, axes, seeds, a budget and what is scored (docs/sweeps.md). Several "
      "`sweep run` share the work\n"
      "over one directory. Examples:\n\n"
      "  slalom sweep plan configs/sweeps/training-sets.toml\n"
      "  slalom sweep run configs/sweeps/training-sets.toml --set sweep.seeds=[1] --set "
      "run.max_steps=200000\n");
}

}  // namespace slalom::cli
