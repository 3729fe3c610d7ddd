#include "base/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "base/check.h"

namespace slalom::base {
namespace {

std::vector<char*> Pointers(const std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  pointers.reserve(texts.size() + 1);
  for (const std::string& text : texts) pointers.push_back(const_cast<char*>(text.c_str()));
  pointers.push_back(nullptr);
  return pointers;
}

/// This program's environment with `more` in place of variables of the same names.
std::vector<std::string> Environment(const std::vector<std::string>& more) {
  std::vector<std::string> all = more;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string text = *variable;
    const std::string name = text.substr(0, text.find('=') + 1);
    bool replaced = false;
    for (const std::string& other : more) replaced = replaced || other.starts_with(name);
    if (!replaced) all.push_back(text);
  }
  return all;
}

int ExitCode(int status) {
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

/// Moves a descriptor to a number that no child asks for. Safe after fork.
int MoveAway(int fd) {
  constexpr int kFirstFree = 64;
  return ::fcntl(fd, F_DUPFD_CLOEXEC, kFirstFree);
}

/// Runs in the child between fork and its program. Makes only calls that are safe there.
[[noreturn]] void BecomeProgram(char* const* arguments, char* const* environment,
                                const cpu_set_t* cores, int log,
                                std::vector<std::pair<int, int>>& files, int report, pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(127);
  ::setpgid(0, 0);  // Ctrl-C is the parent's to pass on.
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  if (cores != nullptr) ::sched_setaffinity(0, sizeof(*cores), cores);
  if (log >= 0) {
    ::dup2(log, STDOUT_FILENO);
    ::dup2(log, STDERR_FILENO);
    const int nothing = ::open("/dev/null", O_RDONLY);
    if (nothing >= 0) ::dup2(nothing, STDIN_FILENO);
  }
  bool has_files = true;
  if (!files.empty()) {
    // All are moved before the first gets its number, which may be the present one of another.
    report = MoveAway(report);
    for (auto& [ours, childs] : files) ours = MoveAway(ours);
    for (const auto& [ours, childs] : files) has_files = has_files && ::dup2(ours, childs) >= 0;
  }
  if (has_files) ::execvpe(arguments[0], arguments, environment);
  const int error = errno;
  [[maybe_unused]] const auto written = ::write(report, &error, sizeof(error));
  ::_exit(127);
}

}  // namespace

ChildProcess::ChildProcess(const ChildOptions& options) {
  SLALOM_CHECK(!options.arguments.empty());
  const std::string& program = options.arguments.front();
  const std::vector<std::string> environment = Environment(options.environment);
  const std::vector<char*> argument_pointers = Pointers(options.arguments);
  const std::vector<char*> environment_pointers = Pointers(environment);
  std::vector<std::pair<int, int>> files = options.files;
  cpu_set_t cores;
  CPU_ZERO(&cores);
  for (const int core : options.cores) CPU_SET(static_cast<std::size_t>(core), &cores);
  int log = -1;
  if (!options.log.empty()) {
    log = ::open(options.log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    if (log < 0) {
      throw Error("{}: cannot be written ({})", options.log.string(), std::strerror(errno));
    }
  }
  int pipe[2];
  if (::pipe2(pipe, O_CLOEXEC) != 0) {
    const int error = errno;
    if (log >= 0) ::close(log);
    throw Error("cannot start {}: {}", program, std::strerror(error));
  }
  const pid_t parent = ::getpid();
  pid_ = ::fork();
  if (pid_ == 0) {
    BecomeProgram(argument_pointers.data(), environment_pointers.data(),
                  options.cores.empty() ? nullptr : &cores, log, files, pipe[1], parent);
  }
  int error = pid_ < 0 ? errno : 0;
  ::close(pipe[1]);
  if (log >= 0) ::close(log);
  // Nothing comes from a program that was started, as the pipe closes with that.
  if (pid_ > 0 && ::read(pipe[0], &error, sizeof(error)) <= 0) error = 0;
  ::close(pipe[0]);
  if (error != 0) {
    if (pid_ > 0) ::waitpid(pid_, nullptr, 0);
    if (error == ENOENT) throw ProgramMissing(fmt::format("{} is not installed", program));
    throw Error("cannot start {}: {}", program, std::strerror(error));
  }
  pidfd_ = static_cast<int>(::syscall(SYS_pidfd_open, pid_, 0));
}

ChildProcess::~ChildProcess() {
  if (!exit_code_) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  if (pidfd_ >= 0) ::close(pidfd_);
}

std::optional<int> ChildProcess::Wait(std::chrono::milliseconds time) {
  if (exit_code_) return exit_code_;
  // Without descriptors of processes, as under an old kernel, the wait is a sleep.
  pollfd ended{.fd = pidfd_, .events = POLLIN, .revents = 0};
  ::poll(&ended, pidfd_ >= 0 ? 1 : 0, static_cast<int>(time.count()));
  int status = 0;
  if (::waitpid(pid_, &status, WNOHANG) == pid_) exit_code_ = ExitCode(status);
  return exit_code_;
}

int ChildProcess::Wait() {
  int status = 0;
  while (!exit_code_) {
    if (::waitpid(pid_, &status, 0) == pid_) exit_code_ = ExitCode(status);
  }
  return *exit_code_;
}

void ChildProcess::Signal(int signal) {
  if (!exit_code_) ::kill(pid_, signal);
}

MemoryFile::MemoryFile() : fd_(::memfd_create("slalom", MFD_CLOEXEC)) {
  if (fd_ < 0) throw Error("cannot make a file in memory: {}", std::strerror(errno));
}

MemoryFile::~MemoryFile() { ::close(fd_); }

std::string MemoryFile::Content() const {
  std::string content;
  std::array<char, 65536> bytes;
  ssize_t size = 0;
  while ((size = ::pread(fd_, bytes.data(), bytes.size(), static_cast<off_t>(content.size()))) >
         0) {
    content.append(bytes.data(), static_cast<std::size_t>(size));
  }
  return content;
}

ProgramResult RunProgram(std::vector<std::string> arguments) {
  const MemoryFile nothing;
  const MemoryFile output;
  const MemoryFile errors;
  ChildProcess child({.arguments = std::move(arguments),
                      .files = {{nothing.descriptor(), STDIN_FILENO},
                                {output.descriptor(), STDOUT_FILENO},
                                {errors.descriptor(), STDERR_FILENO}}});
  const int exit_code = child.Wait();
  return {exit_code, output.Content(), errors.Content()};
}

std::string HostName() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "host";
}

std::vector<int> AvailableCores() {
  cpu_set_t set;
  CPU_ZERO(&set);
  std::vector<int> cores;
  if (::sched_getaffinity(0, sizeof(set), &set) == 0) {
    for (int core = 0; core < CPU_SETSIZE; ++core) {
      if (CPU_ISSET(static_cast<std::size_t>(core), &set)) cores.push_back(core);
    }
  }
  if (cores.empty()) cores.push_back(0);
  return cores;
}

}  // namespace slalom::base
