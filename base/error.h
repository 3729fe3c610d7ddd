#pragma once

#include <stdexcept>
#include <string>

namespace slalom::base {

/// Something that keeps the program from starting or going on and that its user can mend: a bad
/// config, course file, checkpoint, policy or command line, no space, no permission.
///
/// `what()` is one sentence or two for the user: the file (and line or key), what was found, what
/// was expected. Thrown by constructors and loaders, caught in `main` and at thread entry only.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace slalom::base
