#pragma once

namespace slalom::transport {

/// A flag that a thread can wait for together with sockets. `Set` from any thread and from signal
/// handlers.
class EventFd {
 public:
  /// Throws `base::Error` where the process has no descriptor left.
  EventFd();
  ~EventFd();
  EventFd(const EventFd&) = delete;
  EventFd& operator=(const EventFd&) = delete;

  void Set();
  void Clear();

  /// Readable while it is set.
  int fd() const { return fd_; }

 private:
  const int fd_;
};

}  // namespace slalom::transport
