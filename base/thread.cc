#include "base/thread.h"

#include <fmt/format.h>

#include "base/error.h"

namespace slalom::base {

void ThrowNoThread(std::string_view purpose, const std::system_error& error) {
  throw Error(
      fmt::format("cannot start a thread for {} ({}); expected room for it: use fewer threads, or "
                  "raise the limit of processes (`ulimit -u`, a container's pids limit) or of "
                  "memory",
                  purpose, error.code().message()));
}

}  // namespace slalom::base
