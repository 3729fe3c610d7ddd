#pragma once

#include <chrono>

namespace slalom::cli {

/// When this process was started, loading of its libraries included (which takes about half a
/// second). Within 10 ms; the time of the call where the system does not say.
std::chrono::steady_clock::time_point ProcessStart();

}  // namespace slalom::cli
