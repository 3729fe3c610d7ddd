#include "app/sweep/slurm_tool.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace slalom::sweep {
namespace {

/// A file in memory that a child writes to.
class Capture {
 public:
  explicit Capture(const std::string& program) : fd_(::memfd_create("slalom", MFD_CLOEXEC)) {
    if (fd_ < 0) {
      throw base::Error(fmt::format("{} cannot be started: {}", program, std::strerror(errno)));
    }
  }
  ~Capture() { ::close(fd_); }
  Capture(const Capture&) = delete;
  Capture& operator=(const Capture&) = delete;

  int get() const { return fd_; }
  std::string Content() const {
    std::string content;
    std::array<char, 65536> bytes{};
    ssize_t size = 0;
    while ((size = ::pread(fd_, bytes.data(), bytes.size(), static_cast<off_t>(content.size()))) >
           0) {
      content.append(bytes.data(), static_cast<std::size_t>(size));
    }
    return content;
  }

 private:
  int fd_;
};

}  // namespace

ToolAnswer RunTool(const std::vector<std::string>& arguments) {
  const Capture output(arguments.front());
  const Capture errors(arguments.front());
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, output.get(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors.get(), STDERR_FILENO);
  std::vector<char*> pointers;
  pointers.reserve(arguments.size() + 1);
  for (const std::string& argument : arguments) {
    pointers.push_back(const_cast<char*>(argument.c_str()));
  }
  pointers.push_back(nullptr);
  pid_t child = -1;
  const int error =
      posix_spawnp(&child, pointers.front(), &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT) return {.is_installed = false, .exit_code = 0, .output = {}, .errors = {}};
  if (error != 0) {
    throw base::Error(
        fmt::format("{} cannot be started: {}", arguments.front(), std::strerror(error)));
  }
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return {true, WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), output.Content(),
          errors.Content()};
}

}  // namespace slalom::sweep
