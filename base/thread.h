#pragma once

#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

namespace slalom::base {

/// Throws the `base::Error` of `StartThread`.
[[noreturn]] void ThrowNoThread(std::string_view purpose, const std::system_error& error);

/// Starts a thread that calls `body`, as `std::jthread` does. Throws `base::Error` if the system
/// refuses it, as it does at a limit of processes or without memory for a stack. `purpose`: the
/// thread's work, for that error. An owner of several threads has to end those that it has started
/// by then, because it waits for them.
template <class Body>
std::jthread StartThread(std::string_view purpose, Body&& body) {
  try {
    return std::jthread(std::forward<Body>(body));
  } catch (const std::system_error& error) {
    ThrowNoThread(purpose, error);
  }
}

}  // namespace slalom::base
