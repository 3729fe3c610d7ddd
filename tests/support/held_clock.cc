#include "tests/support/held_clock.h"

#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

namespace {

thread_local const std::atomic<std::int64_t>* held_ns = nullptr;

}  // namespace

/// Stands in for the C library's function, which `std::chrono::steady_clock` and ZeroMQ call.
extern "C" int clock_gettime(clockid_t clock, timespec* time) noexcept {
  if (clock != CLOCK_MONOTONIC || held_ns == nullptr) {
    return static_cast<int>(syscall(SYS_clock_gettime, clock, time));
  }
  constexpr std::int64_t kSecond = 1'000'000'000;
  const std::int64_t now_ns = *held_ns;
  time->tv_sec = now_ns / kSecond;
  time->tv_nsec = now_ns % kSecond;
  return 0;
}

namespace slalom::test {

HeldClock::HeldClock(bool is_for_this_thread)
    : now_ns_(
          std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count()) {
  if (is_for_this_thread) Share();
}

HeldClock::~HeldClock() { held_ns = nullptr; }

void HeldClock::Advance(std::chrono::nanoseconds time) { now_ns_ += time.count(); }

void HeldClock::Share() const { held_ns = &now_ns_; }

}  // namespace slalom::test
