#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

/// Runs the real program, as a user does.

namespace slalom::test {

struct ProgramResult {
  int exit_code = -1;  ///< 128 + signal where one ended it.
  std::string out;     ///< Standard output.
  std::string err;     ///< Standard error.
};

/// Runs `slalom` with these arguments in `directory` and waits for it.
ProgramResult RunProgram(const std::vector<std::string>& arguments,
                         const std::filesystem::path& directory);

/// Runs a shell command in `directory`; `$SLALOM` is the program.
ProgramResult RunShell(const std::string& command, const std::filesystem::path& directory);

/// `slalom` running in the background, its output in files of `directory`.
class BackgroundProgram {
 public:
  BackgroundProgram(const std::vector<std::string>& arguments,
                    const std::filesystem::path& directory);
  ~BackgroundProgram();
  BackgroundProgram(const BackgroundProgram&) = delete;
  BackgroundProgram& operator=(const BackgroundProgram&) = delete;

  void Signal(int signal) const;
  /// Waits for its end; the exit code as in `ProgramResult`.
  int Wait();

 private:
  pid_t pid_ = -1;
};

/// Whether metrics.csv of a run's directory has rows below its names in which the run learns.
bool HasLearned(const std::filesystem::path& run);

/// A config of a tiny deterministic run of `max_steps` steps, written to `directory`/tiny.toml.
void WriteTinyConfig(const std::filesystem::path& directory, int max_steps,
                     const std::string& more = "");

}  // namespace slalom::test
