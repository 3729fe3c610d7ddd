#include "base/file_lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "base/error.h"

namespace slalom::base {

FileLock::FileLock(const std::filesystem::path& path, int flags, std::string_view refusal)
    : fd_(::open(path.c_str(), flags | O_CLOEXEC, 0644)) {
  if (fd_ < 0) {
    throw Error(fmt::format("{}: cannot be opened ({})", path.string(), std::strerror(errno)));
  }
  if (::flock(fd_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
  ::close(fd_);
  throw Error(fmt::format("{}: {}", path.string(), refusal));
}

// NFS locks only files that are open for writing.
FileLock FileLock::OfFile(const std::filesystem::path& file, std::string_view refusal) {
  return {file, O_RDWR | O_CREAT, refusal};
}

FileLock FileLock::OfDirectory(const std::filesystem::path& directory, std::string_view refusal) {
  return {directory, O_RDONLY | O_DIRECTORY, refusal};
}

FileLock::~FileLock() {
  if (fd_ >= 0) ::close(fd_);
}

FileLock::FileLock(FileLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

}  // namespace slalom::base
