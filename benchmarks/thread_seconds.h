#pragma once

#include <ctime>

namespace slalom {

/// Processor time of this thread [s]: other programs on the machine do not count.
inline double ThreadSeconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace slalom
