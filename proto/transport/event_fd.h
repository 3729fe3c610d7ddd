#pragma once

namespace slalom::transport {

/// A flag that a thread can wait for together with sockets. `Set` may be called from any thread and
/// in signal handlers.
class EventFd {
 public:
  /// Throws `base::Error` if the process has no descriptor left.
  EventFd();
  ~EventFd();
  EventFd(const EventFd&) = delete;
  EventFd& operator=(const EventFd&) = delete;

  void Set();
  void Clear();

  /// A descriptor that is readable while the flag is set.
  int fd() const { return fd_; }

 private:
  const int fd_;
};

}  // namespace slalom::transport
