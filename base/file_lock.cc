#include "base/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "base/error.h"
#include "base/log.h"

namespace slalom::base {

// NFS locks only files that are open for writing.
FileLock::FileLock(const std::filesystem::path& path, std::string_view refusal)
    : fd_(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644)) {
  if (fd_ < 0) throw Error("{}: cannot be opened ({})", path.string(), std::strerror(errno));
  if (::flock(fd_, LOCK_EX | LOCK_NB) == 0) return;
  if (errno != EWOULDBLOCK) {
    spdlog::warn("{}: cannot be locked ({}); see to it that no other process uses it",
                 path.string(), std::strerror(errno));
    return;
  }
  ::close(fd_);
  throw Error("{}: {}", path.string(), refusal);
}

FileLock FileLock::OfFile(const std::filesystem::path& file, std::string_view refusal) {
  return {file, refusal};
}

FileLock::~FileLock() {
  if (fd_ >= 0) ::close(fd_);
}

FileLock::FileLock(FileLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

}  // namespace slalom::base
