#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace slalom::base {

/// Options for starting a program.
struct ChildOptions {
  std::vector<std::string> arguments;  ///< The first one is the program, looked up in PATH.
  std::filesystem::path log{};  ///< Output is appended to this file. Empty for this program's.
  std::vector<int> cores{};     ///< Processors that it may use; empty for all of this program's.
  std::vector<std::string> environment{};  ///< "NAME=VALUE", in addition to this program's.
};

/// A program that runs beside this one. If this program ends for any reason, the child is killed,
/// so that it does not run on unnoticed. Confined to the thread that made it, which must live as
/// long as the child.
class ChildProcess {
 public:
  /// Starts it. Throws `Error` if it cannot be started or the log cannot be written.
  explicit ChildProcess(const ChildOptions& options);
  /// Kills a child that still runs.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// Waits up to `time` for the child to exit. Returns its exit code, or 128 plus the number of the
  /// signal that ended it, or nothing if it still runs.
  std::optional<int> Wait(std::chrono::milliseconds time);

  /// Sends the child a signal. Does nothing if it has ended.
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
