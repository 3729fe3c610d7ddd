#include "replay/lazy_memory.h"

#include <sys/mman.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace slalom::replay {

LazyMemory::LazyMemory(std::size_t bytes) : bytes_(bytes) {
  if (bytes == 0) return;
  void* const memory = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE,
                              MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (memory == MAP_FAILED) {
    throw base::Error(
        "cannot reserve {} MiB for the replay buffer: {}; choose a smaller replay.capacity",
        bytes >> 20, std::strerror(errno));
  }
  data_ = static_cast<std::byte*>(memory);
  // Only advice: the array also works on a system without huge pages.
  (void)::madvise(memory, bytes, MADV_HUGEPAGE);
}

LazyMemory::~LazyMemory() {
  if (data_ != nullptr) ::munmap(data_, bytes_);
}

}  // namespace slalom::replay
