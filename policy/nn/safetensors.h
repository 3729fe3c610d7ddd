#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// Named tensors in a file that Python reads: https://huggingface.co/docs/safetensors. Eight bytes
/// with the length of the header (little-endian), the header as JSON, then the tensors, row-major
/// and little-endian. This project adds the XXH3 checksum of the tensors' bytes to the header's
/// metadata, "checksum_xxh3".

namespace slalom::nn {

template <class T>
inline constexpr std::string_view kTensorType{};
template <>
inline constexpr std::string_view kTensorType<float> = "F32";
template <>
inline constexpr std::string_view kTensorType<double> = "F64";
template <>
inline constexpr std::string_view kTensorType<std::int64_t> = "I64";
template <>
inline constexpr std::string_view kTensorType<std::uint64_t> = "U64";
template <>
inline constexpr std::string_view kTensorType<std::uint16_t> = "U16";
template <>
inline constexpr std::string_view kTensorType<std::uint8_t> = "U8";

/// A tensor as bytes. A value.
struct StoredTensor {
  std::string type;  ///< "F32", "I64", ... as the format names them.
  std::vector<std::int64_t> shape;
  std::string bytes;  ///< Row-major.

  template <class T>
  static StoredTensor Of(std::span<const T> values, std::vector<std::int64_t> shape) {
    static_assert(!kTensorType<T>.empty());
    return {std::string(kTensorType<T>), std::move(shape),
            std::string(reinterpret_cast<const char*>(values.data()), values.size_bytes())};
  }
  template <class T>
  static StoredTensor Of(std::span<const T> values) {
    return Of(values, {static_cast<std::int64_t>(values.size())});
  }

  friend bool operator==(const StoredTensor&, const StoredTensor&) = default;
};

using TensorMap = std::map<std::string, StoredTensor>;
using Metadata = std::map<std::string, std::string>;

/// Contents of a file. Errors call it `source`.
struct TensorFile {
  std::string source;
  TensorMap tensors;
  Metadata metadata;  ///< Without the checksum.

  /// Copies a tensor's numbers into `values`.
  /// Throws `base::Error` if it is missing or has another type or number of elements.
  template <class T, std::size_t kExtent>
  void Read(const std::string& name, std::span<T, kExtent> values) const {
    std::memcpy(values.data(), Find(name, kTensorType<T>, values.size()).bytes.data(),
                values.size_bytes());
  }

 private:
  const StoredTensor& Find(const std::string& name, std::string_view type, std::size_t size) const;
};

/// Prints the bytes of a file.
std::string PrintTensors(const TensorMap& tensors, const Metadata& metadata);

/// Reads the bytes of `PrintTensors`, or of any other safetensors file (which has no checksum to
/// compare). Throws `base::Error` that begins with `source` if they are cut short, are not a
/// safetensors file or do not match their checksum. Allocates at most a few times their size, for
/// any bytes.
TensorFile ParseTensors(std::span<const std::byte> bytes, std::string_view source);

/// Writes the file whole or not at all. Throws `base::Error` if that fails.
void SaveTensors(const std::filesystem::path& path, const TensorMap& tensors,
                 const Metadata& metadata);

/// Reads a file. Throws `base::Error` naming the file if it cannot be read, or as `ParseTensors`
/// does.
TensorFile LoadTensors(const std::filesystem::path& path);

}  // namespace slalom::nn
