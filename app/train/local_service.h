#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/train/run_config.h"
#include "base/child_process.h"

namespace slalom::train {

/// Options of a service on this machine.
struct LocalServiceOptions {
  std::filesystem::path program;  ///< `slalom` itself.
  RunConfig config;               ///< Config of the training. Its addresses and keys do not count.
  int num_actors = 1;
  int num_replay_servers = 1;
  bool evaluator = false;           ///< Whether one scores the learner's policies meanwhile.
  std::filesystem::path directory;  ///< For config, keys, journal and the actors' files.
  std::filesystem::path run;        ///< The run's directory.
  /// The output of all processes is appended to it. Empty: of each to logs/NAME.log in `directory`.
  std::filesystem::path log{};
  std::vector<int> cores{};  ///< As in `base::ChildOptions`.
  std::vector<std::string> environment{};
};

/// A service on this machine: replay servers, a learner, actors and an evaluator, as child
/// processes that end with this one. They meet at addresses of this machine that are new at each
/// start, and so are their keys: no other process can take part.
///
/// A process that something else ended, by whatever signal, is started again. If that happens to
/// one five times in a row within ten seconds of its start, or if a process ends with an error,
/// the service ends. Confined to the thread that made it, which must live as long.
class LocalService {
 public:
  /// Starts the service, which continues if `directory` and `run` hold its files. Throws
  /// `base::Error` if files cannot be written or a process cannot be started.
  explicit LocalService(const LocalServiceOptions& options);
  /// Kills what still runs.
  ~LocalService();
  LocalService(const LocalService&) = delete;
  LocalService& operator=(const LocalService&) = delete;

  /// Looks after the processes for about `time`. Returns nothing while they run, and the learner's
  /// exit code once all have ended: because the training ended, or after `Signal`. Returns
  /// `base::kExitError` if the service ended for the reason in `fault`.
  std::optional<int> Wait(std::chrono::milliseconds time);

  /// Sends each process a signal that ends it. It is not started again.
  void Signal(int signal);

  /// The config of all processes, for those who ask them.
  const RunConfig& config() const { return service_config_; }

  /// How often a process was started again.
  int num_restarts() const { return num_restarts_; }

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

  const LocalServiceOptions options_;
  const RunConfig service_config_;
  const std::filesystem::path config_file_;
  std::vector<Member> members_;                ///< The learner first.
  std::optional<int> exit_code_;               ///< Set once the service is to end.
  std::optional<Clock::time_point> deadline_;  ///< After which what still runs is killed.
  int num_restarts_ = 0;
  std::string fault_;
};

}  // namespace slalom::train
