#include "tests/support/allocation_count.h"

#include <atomic>
#include <cstdlib>
#include <new>

namespace {

std::atomic<long> num_allocations{0};
std::atomic<long> num_bytes{0};

void Count(std::size_t size) {
  ++num_allocations;
  num_bytes += static_cast<long>(size);
}

}  // namespace

namespace slalom::test {

long NumAllocations() { return num_allocations; }
long NumAllocatedBytes() { return num_bytes; }

}  // namespace slalom::test

void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  Count(size);
  return std::malloc(size == 0 ? 1 : size);
}
void* operator new(std::size_t size) {
  if (void* memory = ::operator new(size, std::nothrow)) return memory;
  throw std::bad_alloc();
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  Count(size);
  const auto step = static_cast<std::size_t>(alignment);
  // A multiple of the alignment, as std::aligned_alloc wants it.
  if (void* memory = std::aligned_alloc(step, (size + step) / step * step)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
