#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/sweep/cell.h"
#include "app/train/run_config.h"
#include "base/child_process.h"

namespace slalom::sweep {

/// Trains a run below `output` from a config, or goes on with the run `output` if there is no
/// config. Scores nothing.
std::vector<std::string> TrainCommand(const std::filesystem::path& program,
                                      const std::optional<std::filesystem::path>& config,
                                      const std::filesystem::path& output);

/// Environment variables that give the libraries of a child process so many threads.
std::vector<std::string> ThreadLimits(int threads);

/// One evaluation that `EvaluateCommand` runs.
struct ScoreCommand {
  std::optional<std::filesystem::path> policy;  ///< Empty if the cell's planner drives.
  std::filesystem::path config;
  std::filesystem::path output;  ///< Replaced if it is there.
  int threads = 1;
};

/// Scores a cell as `task` says.
std::vector<std::string> EvaluateCommand(const std::filesystem::path& program, const Cell& cell,
                                         const ScoreTask& task, const ScoreCommand& score);

/// Options of a cell's service.
struct CellServiceOptions {
  std::filesystem::path program;  ///< `slalom` itself.
  train::RunConfig config;        ///< Config of the training. Its addresses and keys do not count.
  int num_actors = 1;
  std::filesystem::path directory;  ///< For config, keys, journal and the actors' files.
  std::filesystem::path run;        ///< The run's directory.
  std::filesystem::path log;        ///< The output of all processes is appended to it.
  std::vector<int> cores{};         ///< As in `base::ChildOptions`.
  std::vector<std::string> environment{};
};

/// The service that trains one cell: a replay server, a learner and actors, as child processes that
/// end with this one. They meet at addresses of this machine that are new at each start, and so are
/// their keys: no other process can take part.
///
/// A process that something else ended, by whatever signal, is started again. If that happens to
/// one five times in a row within ten seconds of its start, or if a process ends with an error,
/// the service ends. Confined to the thread that made it, which must live as long.
class CellService {
 public:
  /// Starts the service, which continues if `directory` and `run` hold its files. Throws
  /// `base::Error` if files cannot be written or a process cannot be started.
  explicit CellService(const CellServiceOptions& options);
  /// Kills what still runs.
  ~CellService();
  CellService(const CellService&) = delete;
  CellService& operator=(const CellService&) = delete;

  /// Looks after the processes for about `time`. Returns nothing while they run, and the learner's
  /// exit code once all have ended: because the training ended, or after `Signal`. Returns
  /// `base::kExitError` if the service ended for the reason in `fault`.
  std::optional<int> Wait(std::chrono::milliseconds time);

  /// Sends each process a signal that ends it. It is not started again.
  void Signal(int signal);

  /// Why the service ended, as a sentence without its full stop. Empty if the training ended.
  const std::string& fault() const { return fault_; }

 private:
  using Clock = std::chrono::steady_clock;

  /// A process of the service.
  struct Member {
    std::string command;  ///< "slalom actor --name actor-1", for people.
    base::ChildOptions options;
    std::unique_ptr<base::ChildProcess> process{};
    std::optional<int> exit_code{};  ///< Once it has ended.
    Clock::time_point started{};
    int num_quick_ends = 0;  ///< In a row.
  };

  void Add(const std::string& role, const std::string& name);
  void Start(Member& member);
  void LookAfter(Member& member);
  void End(int exit_code);
  bool IsTrained() const;

  const CellServiceOptions options_;
  std::filesystem::path config_;
  std::vector<Member> members_;                ///< The learner first.
  std::optional<int> exit_code_;               ///< Set once the service is to end.
  std::optional<Clock::time_point> deadline_;  ///< After which what still runs is killed.
  std::string fault_;
};

}  // namespace slalom::sweep
