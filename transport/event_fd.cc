#include "transport/event_fd.h"

#include <fmt/format.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>

#include "base/error.h"

namespace slalom::transport {

EventFd::EventFd() : fd_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (fd_ < 0) throw base::Error(fmt::format("cannot make an eventfd ({})", std::strerror(errno)));
}

EventFd::~EventFd() { close(fd_); }

void EventFd::Set() {
  const std::uint64_t one = 1;
  // Refused only where the count is at its largest, and so is set.
  [[maybe_unused]] const ssize_t ignored = write(fd_, &one, sizeof one);
}

void EventFd::Clear() {
  std::uint64_t count = 0;
  // Refused only where it is clear.
  [[maybe_unused]] const ssize_t ignored = read(fd_, &count, sizeof count);
}

}  // namespace slalom::transport
