#pragma once

#include <fmt/core.h>

#include <stdexcept>
#include <string>
#include <utility>

namespace slalom::base {

/// A problem that keeps the program from starting or continuing and that its user can solve: for
/// example a bad config, course file, checkpoint, policy or command line, no space, no permission.
///
/// `what()` is one or two sentences for the user. They name the file (and line or key), what was
/// found and what was expected. Errors are thrown by constructors and loaders, and caught only in
/// `main` and at the entry of threads.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
  /// With the text that `fmt::format` makes of the arguments.
  template <class First, class... Rest>
  Error(fmt::format_string<First, Rest...> format, First&& first, Rest&&... rest)
      : std::runtime_error(
            fmt::format(format, std::forward<First>(first), std::forward<Rest>(rest)...)) {}
};

/// Throws an `Error` with the text that `fmt::format` makes of the arguments if `condition` holds.
template <class... Args>
void ThrowIf(bool condition, fmt::format_string<Args...> format, Args&&... args) {
  if (condition) throw Error(fmt::format(format, std::forward<Args>(args)...));
}

}  // namespace slalom::base
