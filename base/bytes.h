#pragma once

#include <bit>
#include <cstddef>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

/// Numbers in the bytes of files and messages, little-endian, one after the other.

namespace slalom::base {

static_assert(std::endian::native == std::endian::little, "the formats are little-endian");

template <class T>
concept ByteNumber = std::is_arithmetic_v<T> || std::is_enum_v<T>;

class ByteWriter {
 public:
  template <ByteNumber T>
  void Put(T value) {
    PutBytes(std::as_bytes(std::span(&value, 1)));
  }
  void PutBytes(std::span<const std::byte> raw) {
    bytes_.insert(bytes_.end(), raw.begin(), raw.end());
  }
  void PutText(std::string_view text) { PutBytes(std::as_bytes(std::span(text))); }

  std::string_view text() const {
    return {reinterpret_cast<const char*>(bytes_.data()), bytes_.size()};
  }
  std::vector<std::byte> Take() { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
};

/// Once the bytes are used up, or a bool is neither 0 nor 1, it reads zeros and nothing, and has
/// `failed`.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : bytes_(bytes) {}
  explicit ByteReader(std::string_view text) : bytes_(std::as_bytes(std::span(text))) {}

  template <ByteNumber T>
  T Get() {
    T value{};
    const std::span<const std::byte> raw = GetBytes(sizeof(T));
    if (raw.size() != sizeof(T)) return value;
    if constexpr (std::is_same_v<T, bool>) {
      if (raw[0] > std::byte{1}) return Fail(), false;
    }
    std::memcpy(&value, raw.data(), sizeof(T));
    return value;
  }
  std::span<const std::byte> GetBytes(std::size_t size) {
    if (size > bytes_.size()) return Fail(), std::span<const std::byte>();
    const std::span<const std::byte> result = bytes_.first(size);
    bytes_ = bytes_.subspan(size);
    return result;
  }
  std::string_view GetText(std::size_t size) {
    const std::span<const std::byte> raw = GetBytes(size);
    return {reinterpret_cast<const char*>(raw.data()), raw.size()};
  }

  std::size_t left() const { return bytes_.size(); }
  bool failed() const { return failed_; }
  /// Whether everything could be read and nothing is left.
  bool done() const { return !failed_ && bytes_.empty(); }

 private:
  void Fail() {
    failed_ = true;
    bytes_ = {};
  }

  std::span<const std::byte> bytes_;
  bool failed_ = false;
};

}  // namespace slalom::base
