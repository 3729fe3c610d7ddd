#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace slalom::base {

/// How a program is started.
struct ChildOptions {
  std::vector<std::string> arguments;  ///< The first one is the program, sought in PATH.
  std::filesystem::path
      log{};                 ///< Gets what it prints, at its end; empty: this program's own output.
  std::vector<int> cores{};  ///< Processors that it may use; empty: all that this program may.
  std::vector<std::string> environment{};  ///< "NAME=VALUE", besides this program's own.
};

/// A program that runs beside this one. If this program ends for whatever reason, the child is
/// killed, so that nothing works on unseen. Confined to the thread that made it, which must live
/// as long as the child.
class ChildProcess {
 public:
  /// Starts it. Throws `Error` if it cannot be started or the log cannot be written.
  explicit ChildProcess(const ChildOptions& options);
  /// Kills a child that still runs.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// Waits at most so long for its end. Returns its exit code, or 128 plus the number of the signal
  /// that ended it; none: it still runs.
  std::optional<int> Wait(std::chrono::milliseconds time);

  /// Sends it a signal. Does nothing if it has ended.
  void Signal(int signal);

 private:
  pid_t pid_;
  int pidfd_;
  std::optional<int> exit_code_;
};

/// The name of this machine; "host" if it has none.
std::string HostName();

/// The processors that this program may use, ascending.
std::vector<int> AvailableCores();

}  // namespace slalom::base
