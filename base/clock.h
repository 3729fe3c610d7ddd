#pragma once

#include <chrono>

namespace slalom::base {

/// Now, [s] since 1970 by this machine's clock: for people, files and other machines. What measures
/// a duration takes `std::chrono::steady_clock`.
inline double UnixSeconds() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

}  // namespace slalom::base
