#pragma once

#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

/// This machine: its names, and what it lets a process have.

namespace slalom::base {

/// Raises this process's limit of open files and connections to the hard limit, but not beyond
/// 65,536, because some programs close every number up to the limit that they inherit. A limit that
/// cannot be raised stays. Call it before any thread starts.
void RaiseDescriptorLimit();

/// Returns how many files and connections this process may have open at once.
int DescriptorLimit();

/// Returns how many processors this machine has, at least 1.
int NumProcessors();

/// Whether `host`, a name or an address ("[::1]" or "::1"), is this machine to itself: "localhost",
/// 127.0.0.0/8 or ::1. Asks nobody.
[[nodiscard]] bool IsLocalHost(std::string_view host);

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
