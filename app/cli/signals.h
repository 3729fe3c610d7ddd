#pragma once

#include <stop_token>

namespace slalom::cli {

/// Turns SIGINT, SIGTERM and SIGHUP (the terminal was closed, the connection lost) into a stop
/// request for as long as it lives. SIGINT or SIGTERM again ends the program at once, as it would
/// without this, unless less than a second has passed: a batch system signals every process of a
/// job, and a parent that was told, too, passes it on. SIGHUP again does nothing, since a shell
/// that loses its terminal sends another one after the kernel's; and from the first one on SIGPIPE
/// is ignored, so that a reader of the output which died with the terminal does not end the program
/// before it has saved. If SIGHUP is ignored, as under nohup, it stays ignored. Only one object may
/// exist at a time.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  std::stop_token token() const;

  /// Returns the signal that arrived; 0: none has.
  int received() const;

 private:
  struct Impl;
  Impl* const impl_;
  bool takes_hangup_ = false;
};

}  // namespace slalom::cli
