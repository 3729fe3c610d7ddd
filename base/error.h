#pragma once

#include <stdexcept>
#include <string>

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
};

}  // namespace slalom::base
