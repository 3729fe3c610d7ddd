#include "learner/run/run_directory.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "base/file.h"

namespace slalom::run {

namespace fs = std::filesystem;

fs::path RunDirectory::snapshot(std::int64_t steps) const {
  return snapshots() / fmt::format("step-{:012}.safetensors", steps);
}

std::vector<fs::path> RunDirectory::ListSnapshots() const {
  std::vector<fs::path> paths = base::ListDirectory(snapshots());
  std::erase_if(paths, [](const fs::path& path) { return path.extension() != ".safetensors"; });
  std::ranges::sort(paths);
  return paths;
}

RunLock::RunLock(const fs::path& root)
    : fd_(::open(root.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  if (fd_ < 0) {
    throw base::Error(
        fmt::format("{}: cannot be opened ({})", root.string(), std::strerror(errno)));
  }
  if (::flock(fd_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
  ::close(fd_);
  throw base::Error(fmt::format(
      "{}: another process is training in this directory; stop it, or choose another --name",
      root.string()));
}

RunLock::~RunLock() {
  if (fd_ >= 0) ::close(fd_);
}

RunLock::RunLock(RunLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

}  // namespace slalom::run
