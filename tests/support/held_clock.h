#pragma once

#include <chrono>

namespace slalom::test {

/// Holds the steady clock of the thread that makes it, so that what waits for a time does so
/// without one. Other threads are not affected. A wait of this thread for longer than 0 never ends
/// by its time. A test that uses it is linked with held_clock.cc.
class HeldClock {
 public:
  HeldClock();
  ~HeldClock();
  HeldClock(const HeldClock&) = delete;
  HeldClock& operator=(const HeldClock&) = delete;

  void Advance(std::chrono::nanoseconds time);
};

}  // namespace slalom::test
