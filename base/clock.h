#pragma once

#include <chrono>

namespace slalom::base {

/// The time now, [s] since 1970 by this machine's clock, for people, files and other machines. To
/// measure a duration, use `std::chrono::steady_clock`, because this clock may jump.
inline double UnixSeconds() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

/// The duration since `begin` [s].
inline double SecondsSince(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

}  // namespace slalom::base
