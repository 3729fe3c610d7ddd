#include "tests/replay/failing_syncs.h"

#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>

namespace slalom::replay {
namespace {

std::atomic<bool> failing{false};

}  // namespace

FailingSyncs::FailingSyncs() { failing = true; }
FailingSyncs::~FailingSyncs() { failing = false; }

}  // namespace slalom::replay

/// These take the place of the C library's.
extern "C" int fdatasync(int fd) {
  if (!slalom::replay::failing) return static_cast<int>(::syscall(SYS_fdatasync, fd));
  errno = EIO;
  return -1;
}

extern "C" int fsync(int fd) {
  if (!slalom::replay::failing) return static_cast<int>(::syscall(SYS_fsync, fd));
  errno = EIO;
  return -1;
}
