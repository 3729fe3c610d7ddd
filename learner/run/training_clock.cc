#include "learner/run/training_clock.h"

#include <time.h>

#include <algorithm>
#include <utility>

#include "base/check.h"

namespace slalom::run {
namespace {

double Read(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

ClockReading ReadProcessClocks() {
  return {.wall_s = Read(CLOCK_MONOTONIC), .processor_s = Read(CLOCK_PROCESS_CPUTIME_ID)};
}

TrainingClock::TrainingClock(std::function<ClockReading()> read)
    : read_(std::move(read)), last_(read_()) {}

void TrainingClock::Restore(double training_s) {
  SLALOM_CHECK(!running_);
  training_s_ = training_s;
}

void TrainingClock::Start() {
  if (running_) return;
  last_ = read_();
  running_ = true;
}

void TrainingClock::Stop() {
  Look();
  running_ = false;
}

void TrainingClock::Look() {
  const ClockReading now = read_();
  const double gap = now.wall_s - last_.wall_s;
  const double used = now.processor_s - last_.processor_s;
  if (running_) training_s_ += std::min(gap, std::max(kLongestGap, used));
  last_ = now;
}

}  // namespace slalom::run
