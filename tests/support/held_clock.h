#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>

namespace slalom::test {

/// Holds the steady clock of the thread that makes it, so that what waits for a time does so
/// without one, or only that of threads that `Share` it. Other threads are not affected. A wait of
/// such a thread for longer than 0 does not end by its time before the clock is advanced. A test
/// that uses it is linked with held_clock.cc.
class HeldClock {
 public:
  explicit HeldClock(bool is_for_this_thread = true);
  ~HeldClock();
  HeldClock(const HeldClock&) = delete;
  HeldClock& operator=(const HeldClock&) = delete;

  void Advance(std::chrono::nanoseconds time);
  /// Holds the clock of the calling thread, too, until that thread ends. It must outlive the
  /// thread.
  void Share() const;

 private:
  std::atomic<std::int64_t> now_ns_;
};

}  // namespace slalom::test
