#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace slalom::replay {

/// Bytes that start on a multiple of 8, as a received message does; or so many after one.
class AlignedBytes {
 public:
  explicit AlignedBytes(std::size_t size) : words_(size / 8 + 2), size_(size) {}
  std::span<std::byte> span(std::size_t offset = 0) {
    return std::as_writable_bytes(std::span(words_)).subspan(offset, size_);
  }

 private:
  std::vector<std::uint64_t> words_;
  std::size_t size_;
};

}  // namespace slalom::replay
