#pragma once

#include <stop_token>

namespace slalom::cli {

/// Turns SIGINT, SIGTERM and SIGHUP (the terminal was closed, the connection lost) into a stop
/// request for as long as it lives. A second SIGINT or SIGTERM ends the program at once, as it
/// would without this object, unless less than a second has passed: a batch system signals every
/// process of a job, and a parent that gets the signal passes it on. A second SIGHUP does nothing,
/// because a shell that loses its terminal sends another one after the kernel's. From the first
/// SIGHUP on, SIGPIPE is ignored, so that a reader of the output that died with the terminal does
/// not end the program before it has saved. If SIGHUP is ignored, as under nohup, it stays ignored.
/// Only one object may exist at a time.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  std::stop_token token() const;

  /// Returns the signal that arrived, or 0 if none has.
  int received() const;

  /// Returns once a signal has arrived.
  void Wait() const;

 private:
  struct Impl;
  Impl* const impl_;
  bool takes_hangup_ = false;
};

}  // namespace slalom::cli
