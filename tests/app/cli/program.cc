#include "tests/app/cli/program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

#include "base/file.h"

namespace slalom::test {
namespace {

int ExitCode(int status) {
  return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

/// Starts `arguments` with its output in `directory`/out and `directory`/err.
pid_t Start(const std::vector<std::string>& arguments, const std::filesystem::path& directory) {
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  const pid_t pid = fork();
  if (pid != 0) return pid;
  const auto redirect = [&](const char* name, int to) {
    dup2(open((directory / name).c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644), to);
  };
  redirect("out", STDOUT_FILENO);
  redirect("err", STDERR_FILENO);
  setenv("SLALOM", SLALOM_PROGRAM, 1);
  if (chdir(directory.c_str()) == 0) execv(argv[0], argv.data());
  _exit(127);
}

ProgramResult WaitFor(pid_t pid, const std::filesystem::path& directory) {
  int status = 0;
  EXPECT_EQ(waitpid(pid, &status, 0), pid);
  return {ExitCode(status), base::ReadFile(directory / "out"), base::ReadFile(directory / "err")};
}

std::vector<std::string> WithProgram(const std::vector<std::string>& arguments) {
  std::vector<std::string> all = {SLALOM_PROGRAM};
  all.insert(all.end(), arguments.begin(), arguments.end());
  return all;
}

}  // namespace

ProgramResult RunProgram(const std::vector<std::string>& arguments,
                         const std::filesystem::path& directory) {
  return WaitFor(Start(WithProgram(arguments), directory), directory);
}

ProgramResult RunShell(const std::string& command, const std::filesystem::path& directory) {
  return WaitFor(Start({"/bin/bash", "-c", command}, directory), directory);
}

BackgroundProgram::BackgroundProgram(const std::vector<std::string>& arguments,
                                     const std::filesystem::path& directory)
    : pid_(Start(WithProgram(arguments), directory)) {}

BackgroundProgram::~BackgroundProgram() {
  if (pid_ < 0) return;
  Signal(SIGKILL);
  Wait();
}

void BackgroundProgram::Signal(int signal) const { kill(pid_, signal); }

int BackgroundProgram::Wait() {
  int status = 0;
  EXPECT_EQ(waitpid(pid_, &status, 0), pid_);
  pid_ = -1;
  return ExitCode(status);
}

bool HasLearned(const std::filesystem::path& run) {
  const std::filesystem::path metrics = run / "metrics.csv";
  return std::filesystem::exists(metrics) && std::ranges::count(base::ReadFile(metrics), '\n') > 3;
}

void WriteTinyConfig(const std::filesystem::path& directory, int max_steps,
                     const std::string& more) {
  base::WriteFileAtomically(directory / "tiny.toml", fmt::format(R"(
[run]
name = "tiny"
deterministic = true
max_steps = {}
updates_per_step = 0.03125
learning_starts = 500
log_interval = 0.05
{}
[courses]
train = "static-train-5"
test = "generated:3:4"
[actor]
num_environments = 8
[replay]
capacity = 5000
[network]
encoder_layers = []
head_layers = [16, 16]
sectors = 72
[learner]
batch_size = 32
final_learning_rate_fraction = 0.1
[evaluation]
episodes_per_course = 2
)",
                                                                 max_steps, more));
}

}  // namespace slalom::test
