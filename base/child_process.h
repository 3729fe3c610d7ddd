#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"

namespace slalom::base {

/// Options for starting a program.
struct ChildOptions {
  std::vector<std::string> arguments;  ///< The first one is the program, looked up in PATH.
  std::filesystem::path log{};  ///< Output is appended to this file. Empty for this program's.
  /// Open files of this program that the child gets: our number of each and the child's.
  std::vector<std::pair<int, int>> files{};
  std::vector<int> cores{};  ///< Processors that it may use; empty for all of this program's.
  std::vector<std::string> environment{};  ///< "NAME=VALUE", in addition to this program's.
};

/// The error of a program that is not installed: PATH has no such file.
class ProgramMissing : public Error {
 public:
  using Error::Error;
};

/// A program that runs beside this one. If this program ends for any reason, the child is killed,
/// so that it does not run on unnoticed. Confined to the thread that made it, which must live as
/// long as the child.
class ChildProcess {
 public:
  /// Starts it. Throws `ProgramMissing` if there is no such program, and `Error` if it cannot be
  /// started for another reason or the log cannot be written.
  explicit ChildProcess(const ChildOptions& options);
  /// Kills a child that still runs.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// Waits up to `time` for the child to exit. Returns its exit code, or 128 plus the number of the
  /// signal that ended it, or nothing if it still runs.
  std::optional<int> Wait(std::chrono::milliseconds time);
  /// The same without a limit.
  int Wait();

  /// Sends the child a signal. Does nothing if it has ended.
  void Signal(int signal);

 private:
  pid_t pid_;
  int pidfd_;
  std::optional<int> exit_code_;
};

/// A file without a name, in memory. Its descriptor is open as long as the object.
class MemoryFile {
 public:
  /// Throws `Error` if the system refuses another file.
  MemoryFile();
  ~MemoryFile();
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  int descriptor() const { return fd_; }
  /// Returns everything that was written to it.
  std::string Content() const;

 private:
  int fd_;
};

/// Output and exit code of a program.
struct ProgramResult {
  int exit_code = 0;  ///< As of `ChildProcess::Wait`.
  std::string output;
  std::string errors;
};
/// Runs a program without input and waits for its end. Throws as `ChildProcess`.
ProgramResult RunProgram(std::vector<std::string> arguments);

/// The name of this machine; "host" if it has none.
std::string HostName();

/// The processors that this program may use, ascending.
std::vector<int> AvailableCores();

}  // namespace slalom::base
