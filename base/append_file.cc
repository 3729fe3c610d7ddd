#include "base/append_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "base/error.h"

namespace slalom::base {

AppendFile::AppendFile(std::filesystem::path path, Mode mode) : path_(std::move(path)) {
  const int flags = O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC;
  fd_ = ::open(path_.c_str(), mode == Mode::kMakeNew ? flags | O_EXCL : flags, 0644);
  if (fd_ < 0) throw Error("{}: cannot open ({})", path_.string(), std::strerror(errno));
}

AppendFile::~AppendFile() {
  if (fd_ >= 0) ::close(fd_);
}

AppendFile::AppendFile(AppendFile&& other) noexcept
    : path_(std::move(other.path_)), fd_(std::exchange(other.fd_, -1)) {}

std::optional<Failure> AppendFile::Append(std::string_view bytes) {
  const off_t end = ::lseek(fd_, 0, SEEK_END);
  for (std::string_view rest = bytes; !rest.empty();) {
    const ssize_t n = ::write(fd_, rest.data(), rest.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      const int error = n < 0 ? errno : ENOSPC;
      // An incomplete record would make those after it unreadable, too.
      if (rest.size() < bytes.size() && ::ftruncate(fd_, end) != 0) {
        return Failure{fmt::format("{}: cannot write, nor take back what was written ({})",
                                   path_.string(), std::strerror(error))};
      }
      return Failure{fmt::format("{}: cannot write ({})", path_.string(), std::strerror(error))};
    }
    rest.remove_prefix(static_cast<std::size_t>(n));
  }
  return std::nullopt;
}

}  // namespace slalom::base
