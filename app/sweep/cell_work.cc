#include "app/sweep/cell_work.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>

#include "app/sweep/cell_commands.h"
#include "app/sweep/store.h"
#include "app/train/local_service.h"
#include "app/train/resolved_run.h"
#include "app/train/trained_policy.h"
#include "base/child_process.h"
#include "base/clock.h"
#include "base/config.h"
#include "base/error.h"
#include "base/exit_code.h"
#include "base/file.h"
#include "base/log.h"
#include "learner/run/checkpoint_store.h"
#include "learner/run/fence.h"
#include "learner/run/metrics_table.h"
#include "learner/run/run_directory.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr int kAttempts = 3;
constexpr std::chrono::seconds kTimeToSave{120};

/// The end of a file that was written after its first `begin` bytes: its last lines.
std::string EndOfLog(const fs::path& path, std::uintmax_t begin) {
  constexpr std::size_t kMaxBytes = 3000;
  std::ifstream file(path);
  file.seekg(static_cast<std::streamoff>(begin));
  std::string text(std::istreambuf_iterator<char>(file), {});
  if (text.size() > kMaxBytes) {
    text.erase(0, text.size() - kMaxBytes);
    text.erase(0, text.find('\n') + 1);
  }
  return text;
}

/// The most steps by which a training makes a snapshot later than it is due.
std::int64_t LatenessOfSnapshots(const Cell& cell) {
  const train::RunConfig& config = *cell.config;
  // A process looks after each batch step.
  if (cell.num_actors == 0) return config.actor.num_environments;
  // The learner of a service looks after each batch that it gets. The first one comes after
  // run.learning_starts, and from one to the next the actors make as many steps as the replay
  // server lets in.
  if (config.replay_server.max_ahead_steps == 0) return config.run.max_steps;
  const std::int64_t chunk =
      std::max(config.actor_service.chunk_rows, config.actor.num_environments);
  return config.run.learning_starts + config.replay_server.max_ahead_steps +
         std::llround(std::ceil(1.0 / config.run.updates_per_step)) + cell.num_actors * chunk;
}

/// Where a run lies that another run replaced.
fs::path BackupPath(const fs::path& run) { return run.string() + ".aside"; }

/// The work on one cell.
class Work {
 public:
  Work(const Cell& cell, const WorkOptions& options, Claim& claim, const std::stop_token& stop)
      : cell_(cell),
        options_(options),
        directory_(options.store, cell.id),
        claim_(claim),
        stop_(stop) {}

  WorkEnd Run() {
    Prepare();
    for (int attempt = 1; attempt <= kAttempts; ++attempt) {
      std::error_code ec;
      const std::uintmax_t log_begin =
          fs::exists(directory_.log(), ec) ? fs::file_size(directory_.log(), ec) : 0;
      const std::optional<WorkEnd> end = Attempt();
      if (end && *end != WorkEnd::kFailed) return *end;
      if (!end || attempt == kAttempts) {
        WriteFailure(directory_, {.what = fault_, .log = EndOfLog(directory_.log(), log_begin)});
        return WorkEnd::kFailed;
      }
      spdlog::warn("{}: {}; trying again ({} of {})", cell_.name(), fault_, attempt + 1, kAttempts);
    }
    return WorkEnd::kFailed;
  }

 private:
  void Prepare() const {
    base::MakeDirectories(directory_.root() / "scores");
    const nlohmann::ordered_json facts = {{"id", cell_.id},
                                          {"row", cell_.row_name()},
                                          {"seed", cell_.seed},
                                          {"planner", cell_.planner},
                                          {"training_courses", cell_.num_training_courses}};
    base::WriteFileAtomically(directory_.facts(), facts.dump(2) + "\n");
    if (cell_.config) base::WriteFileAtomically(directory_.config(), config::ToToml(*cell_.config));
    std::error_code ec;
    fs::remove(directory_.failed(), ec);
  }

  /// The remaining work on a cell's training.
  enum class Training { kNothing, kToBegin, kToResume, kForeignClaim };

  /// Looks at the run, and moves one that cannot go on out of the way. Throws `base::Error`, and
  /// changes nothing, if it cannot be looked at: it may be there all the same.
  Training PrepareTraining() const {
    if (!cell_.config) return Training::kNothing;
    const run::RunDirectory run{directory_.run()};
    if (LacksPolicy(options_.store, cell_)) {
      ForgetImported();
    } else if (base::Exists(directory_.trained())) {
      return Training::kNothing;
    }
    if (!base::Exists(run.root)) return Training::kToBegin;
    if (IsTrainedByAnother(run)) return Training::kForeignClaim;
    if (base::Exists(run.config()) && HasProgress(run)) return Training::kToResume;
    SetAside(run.root);  // The training was killed before its first checkpoint.
    return Training::kToBegin;
  }

  /// Whether the run has a checkpoint, or its first stage has begun.
  bool HasProgress(const run::RunDirectory& run) const {
    const fs::path first = train::RunsOf(*cell_.config, run.root).front();
    if (first != run.root && base::Exists(first)) return true;
    return base::Exists(run.checkpoints()) &&
           !run::CheckpointStore(run.checkpoints()).List().empty();
  }

  /// Removes results that were imported, as scores of two trainings do not belong together.
  void ForgetImported() const {
    spdlog::warn(
        "{}: its results were imported without its policy, which a score needs that they do not "
        "have; training it again",
        cell_.name());
    std::error_code ec;
    fs::remove(directory_.trained(), ec);
    fs::remove_all(directory_.root() / "scores", ec);
    base::MakeDirectories(directory_.root() / "scores");
  }

  /// Moves a run out of the way, in place of one that was moved before.
  static void SetAside(const fs::path& root) {
    const fs::path aside = BackupPath(root);
    std::error_code ec;
    fs::remove_all(aside, ec);
    fs::rename(root, aside, ec);
    if (!ec) return;
    throw base::Error("{}: cannot be moved to {} ({})", root.string(), aside.string(),
                      ec.message());
  }

  /// Trains and scores the cell. Empty if it failed and another attempt would fail alike.
  std::optional<WorkEnd> Attempt() {
    Training training = Training::kNothing;
    try {
      training = PrepareTraining();
    } catch (const base::Error& error) {
      fault_ = error.what();
      return WorkEnd::kFailed;
    }
    if (training == Training::kForeignClaim) return WorkEnd::kLost;
    if (training != Training::kNothing) {
      const std::optional<WorkEnd> end = Train(training == Training::kToResume);
      if (!end || *end != WorkEnd::kDone) return end;
    }
    return Score();
  }

  std::optional<WorkEnd> Train(bool resume) {
    const run::RunDirectory run{directory_.run()};
    const Clock::time_point begin = Clock::now();
    const Ended ended = cell_.num_actors > 0 ? RunService(resume) : RunTraining(resume);
    if (ended.end) return *ended.end;
    if (ended.exit_code == base::kExitDiverged || ended.exit_code == base::kExitLearnedNothing) {
      fault_ = ended.exit_code == base::kExitDiverged ? "the training diverged"
                                                      : "the training learned nothing";
      if (cell_.config->run.deterministic) return std::nullopt;
      std::error_code ignored;
      fs::remove_all(run.root, ignored);  // The next attempt begins again.
      return WorkEnd::kFailed;
    }
    if (ended.exit_code != 0) return WorkEnd::kFailed;
    const train::PolicyFigures trained = train::ReadPolicyFigures(run.policy());
    train::PolicyFigures stages;
    for (const fs::path& stage : train::RunsOf(*cell_.config, run.root)) {
      if (stage != run.root) stages += train::ReadPolicyFigures(run::RunDirectory{stage}.policy());
    }
    const double imagined = run::ReadLastMetrics(run.metrics()).Last("imagined_transitions");
    WriteTrained(directory_,
                 {.steps = trained.steps,
                  .updates = trained.updates,
                  .imagined = imagined > 0.0 ? std::optional(std::llround(imagined)) : std::nullopt,
                  .training_s = trained.training_s,
                  .wall_s = base::SecondsSince(begin),
                  .host = base::HostName(),
                  .platform = options_.platform,
                  .commit = options_.commit,
                  .stages = stages,
                  .at_once = options_.at_once});
    return WorkEnd::kDone;
  }

  /// Whether a process of a worker that lost its claim still writes to the run.
  static bool IsTrainedByAnother(const run::RunDirectory& run) {
    try {
      const run::RunLock lock(run.root);
      return false;
    } catch (const base::Error&) {
      return true;
    }
  }

  WorkEnd Score() {
    const Clock::time_point begin = Clock::now();
    std::int64_t episodes = 0;
    std::error_code ignored;
    const run::RunDirectory run{directory_.run()};
    fs::remove_all(run.checkpoints(), ignored);
    fs::remove_all(BackupPath(run.root), ignored);
    fs::remove_all(directory_.service(), ignored);
    bool has_failed = false;
    for (const ScoreTask& task : cell_.scores) {
      if (IsScored(options_.store, cell_, task)) continue;
      const WorkEnd end = ScoreOn(task);
      if (end == WorkEnd::kStopped || end == WorkEnd::kLost) return end;
      has_failed = has_failed || end == WorkEnd::kFailed;
      episodes += task.num_episodes;
    }
    if (has_failed) return WorkEnd::kFailed;
    if (episodes > 0) {
      WriteScored(directory_, {.wall_s = base::SecondsSince(begin), .episodes = episodes});
    }
    return WorkEnd::kDone;
  }

  WorkEnd ScoreOn(const ScoreTask& task) {
    base::WriteFileAtomically(directory_.score_task(task), task.task);
    ScoreCommand score{.policy = std::nullopt,
                       .config = directory_.score_task(task),
                       .output = directory_.score(task),
                       .threads = options_.threads};
    if (cell_.config) {
      fault_ = fmt::format("the training kept no policy at {} steps", task.snapshot_steps);
      try {
        score.policy = PolicyOf(task);
      } catch (const base::Error& error) {
        fault_ = error.what();
      }
      if (!score.policy) return WorkEnd::kFailed;
    }
    const Ended ended = RunChild(EvaluateCommand(options_.program, cell_, task, score));
    if (ended.end) return *ended.end;
    if (ended.exit_code == 0 && IsScored(options_.store, cell_, task)) return WorkEnd::kDone;
    fault_ = fmt::format("`slalom evaluate` ended with exit code {} (score '{}')", ended.exit_code,
                         task.name);
    return WorkEnd::kFailed;
  }

  /// The trained policy, or the first snapshot with as many steps as the task asks for.
  std::optional<fs::path> PolicyOf(const ScoreTask& task) const {
    const run::RunDirectory run{directory_.run()};
    if (task.snapshot_steps == 0) return run.policy();
    // A training makes a snapshot at or soon after the number, and one of a later number does not
    // stand in for it, unless it is the first after both.
    const std::int64_t lateness = LatenessOfSnapshots(cell_);
    std::int64_t end = cell_.config->run.max_steps + lateness;
    for (const int steps : cell_.config->run.snapshot_steps) {
      if (steps > task.snapshot_steps) end = std::min<std::int64_t>(end, steps);
    }
    end = std::max(end, task.snapshot_steps + lateness);
    const std::vector<fs::path> snapshots = run.ListSnapshots();
    const auto first = std::ranges::lower_bound(snapshots, run.snapshot(task.snapshot_steps));
    if (first == snapshots.end() || *first >= run.snapshot(end)) return std::nullopt;
    return *first;
  }

  /// How a child ended: by itself, or because the work ends.
  struct Ended {
    int exit_code = 0;
    std::optional<WorkEnd> end;
  };

  Ended RunChild(const std::vector<std::string>& arguments) {
    base::ChildProcess child({.arguments = arguments,
                              .log = directory_.log(),
                              .cores = options_.cores,
                              .environment = Environment()});
    return Await(child);
  }

  /// Environment of the child processes.
  std::vector<std::string> Environment() const {
    std::vector<std::string> variables = ThreadLimits(options_.threads);
    variables.push_back(std::string(run::Fence::kVariable) + "=" +
                        fs::absolute(claim_.file()).string());
    return variables;
  }

  Ended RunTraining(bool resume) {
    const Ended ended =
        RunChild(resume ? TrainCommand(options_.program, std::nullopt, directory_.run())
                        : TrainCommand(options_.program, directory_.config(), directory_.root()));
    fault_ = fmt::format("`slalom train` ended with exit code {}", ended.exit_code);
    return ended;
  }

  Ended RunService(bool resume) {
    std::error_code ignored;
    if (!resume) fs::remove_all(directory_.service(), ignored);
    train::RunConfig config = *cell_.config;
    config.service.metrics = "";
    train::LocalService service({.program = options_.program,
                                 .config = std::move(config),
                                 .num_actors = cell_.num_actors,
                                 .directory = directory_.service(),
                                 .run = directory_.run(),
                                 .log = directory_.log(),
                                 .cores = options_.cores,
                                 .environment = Environment()});
    const Ended ended = Await(service);
    fault_ = service.fault();
    return ended;
  }

  /// Waits for a `base::ChildProcess` or a `train::LocalService`, and tells it to save and end if
  /// the work ends before it does.
  template <class Job>
  Ended Await(Job& job) {
    Clock::time_point last_beat = Clock::now();
    std::optional<Clock::time_point> stopped;
    for (;;) {
      const std::optional<int> exit_code = job.Wait(std::chrono::milliseconds(200));
      if (exit_code) {
        if (stopped || stop_.stop_requested()) return {*exit_code, WorkEnd::kStopped};
        return {*exit_code, std::nullopt};
      }
      if (Clock::now() - last_beat >= Claim::kBeat) {
        if (!claim_.Renew()) return {0, WorkEnd::kLost};
        last_beat = Clock::now();
      }
      if (stop_.stop_requested() && !stopped) {
        stopped = Clock::now();
        job.Signal(SIGTERM);
      }
      if (stopped && Clock::now() - *stopped > kTimeToSave) return {0, WorkEnd::kStopped};
    }
  }

  const Cell& cell_;
  const WorkOptions& options_;
  const CellDirectory directory_;
  Claim& claim_;
  const std::stop_token stop_;
  std::string fault_;  // Why the last attempt failed.
};

}  // namespace

WorkEnd WorkOnCell(const Cell& cell, const WorkOptions& options, Claim& claim,
                   const std::stop_token& stop) {
  return Work(cell, options, claim, stop).Run();
}

}  // namespace slalom::sweep
