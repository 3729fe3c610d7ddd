#include "tests/support/held_clock.h"

#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

namespace {

thread_local bool is_held = false;
thread_local std::chrono::nanoseconds now{0};

}  // namespace

/// Stands in for the C library's function, which `std::chrono::steady_clock` and ZeroMQ call.
extern "C" int clock_gettime(clockid_t clock, timespec* time) noexcept {
  if (clock != CLOCK_MONOTONIC || !is_held) {
    return static_cast<int>(syscall(SYS_clock_gettime, clock, time));
  }
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(now);
  time->tv_sec = seconds.count();
  time->tv_nsec = (now - seconds).count();
  return 0;
}

namespace slalom::test {

HeldClock::HeldClock() {
  now = std::chrono::steady_clock::now().time_since_epoch();
  is_held = true;
}

HeldClock::~HeldClock() { is_held = false; }

void HeldClock::Advance(std::chrono::nanoseconds time) { now += time; }

}  // namespace slalom::test
