#pragma once

#include <stop_token>

namespace slalom::cli {

/// Turns SIGINT and SIGTERM into a stop request for as long as it lives; the same signal again ends
/// the program at once, as it would without this. One at a time.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  std::stop_token token() const;

  /// The signal that came; 0: none.
  int received() const;

 private:
  struct Impl;
  Impl* const impl_;
};

}  // namespace slalom::cli
