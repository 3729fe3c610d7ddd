#pragma once

#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

/// What each fuzzer gives: called with one input after the other.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace slalom::fuzz {

/// An input, taken from the front; what is not there reads as zeros.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : rest_(std::as_bytes(std::span(data, size))) {}

  template <class T>
  T Take() {
    static_assert(std::is_arithmetic_v<T>);
    T value{};
    const auto bytes = TakeBytes(sizeof(T));
    if (!bytes.empty()) std::memcpy(&value, bytes.data(), bytes.size());
    return value;
  }
  /// One byte, in [low, high].
  int TakeIn(int low, int high) { return low + Take<std::uint8_t>() % (high - low + 1); }
  std::span<const std::byte> TakeBytes(std::size_t size) {
    const auto bytes = rest_.first(std::min(size, rest_.size()));
    rest_ = rest_.subspan(bytes.size());
    return bytes;
  }
  std::span<const std::byte> rest() const { return rest_; }
  std::string_view text() const {
    return {reinterpret_cast<const char*>(rest_.data()), rest_.size()};
  }

 private:
  std::span<const std::byte> rest_;
};

/// A copy that starts on a multiple of 8, as a received message does, and has nothing after it that
/// may be read.
class AlignedCopy {
 public:
  /// `size` bytes: those of `bytes`, then zeros.
  AlignedCopy(std::span<const std::byte> bytes, std::size_t size) : memory_(new std::byte[size]) {
    size_ = size;
    std::fill_n(memory_.get(), size, std::byte{0});
    std::copy_n(bytes.begin(), std::min(bytes.size(), size), memory_.get());
  }
  explicit AlignedCopy(std::span<const std::byte> bytes) : AlignedCopy(bytes, bytes.size()) {}
  std::span<std::byte> bytes() { return {memory_.get(), size_}; }

 private:
  std::unique_ptr<std::byte[]> memory_;
  std::size_t size_ = 0;
};

/// A directory of this process, in memory where there is such a place, empty at the start.
inline std::filesystem::path ScratchDirectory(const std::string& name) {
  namespace fs = std::filesystem;
  const fs::path memory = "/dev/shm";
  const fs::path root = fs::is_directory(memory) ? memory : fs::temp_directory_path();
  const fs::path path = root / ("slalom-" + name + "-fuzz-" + std::to_string(getpid()));
  fs::remove_all(path);
  fs::create_directories(path);
  return path;
}

/// Stops at what must not be.
inline void Require(bool condition) {
  if (!condition) __builtin_trap();
}

}  // namespace slalom::fuzz
