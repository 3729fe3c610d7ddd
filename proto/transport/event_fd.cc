#include "proto/transport/event_fd.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>

#include "base/error.h"

namespace slalom::transport {

EventFd::EventFd() : fd_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (fd_ < 0) throw base::Error("cannot make an eventfd ({})", std::strerror(errno));
}

EventFd::~EventFd() { close(fd_); }

void EventFd::Set() {
  const std::uint64_t one = 1;
  // This fails only if the count is at its maximum, and then the flag is set.
  [[maybe_unused]] const ssize_t ignored = write(fd_, &one, sizeof one);
}

void EventFd::Clear() {
  std::uint64_t count = 0;
  // This fails only if the flag is clear already.
  [[maybe_unused]] const ssize_t ignored = read(fd_, &count, sizeof count);
}

}  // namespace slalom::transport
