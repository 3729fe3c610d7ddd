#include "app/sweep/xz.h"

#include <fmt/format.h>
#include <lzma.h>

#include <algorithm>
#include <cstdint>
#include <new>

#include "base/error.h"

namespace slalom::sweep {
namespace {

constexpr std::size_t kMaxText = std::size_t{1} << 30;

const std::uint8_t* Bytes(std::string_view text) {
  return reinterpret_cast<const std::uint8_t*>(text.data());
}

std::uint8_t* Bytes(std::string& text) { return reinterpret_cast<std::uint8_t*>(text.data()); }

}  // namespace

std::string CompressXz(std::string_view text) {
  std::string bytes(lzma_stream_buffer_bound(text.size()), '\0');
  std::size_t size = 0;
  if (lzma_easy_buffer_encode(LZMA_PRESET_DEFAULT, LZMA_CHECK_CRC64, nullptr, Bytes(text),
                              text.size(), Bytes(bytes), &size, bytes.size()) != LZMA_OK) {
    throw std::bad_alloc();
  }
  bytes.resize(size);
  return bytes;
}

std::string DecompressXz(std::string_view bytes, const std::string& source) {
  std::string text(std::max<std::size_t>(16 * bytes.size(), 4096), '\0');
  while (true) {
    std::uint64_t memory = kMaxText;
    std::size_t read = 0, written = 0;
    const lzma_ret end = lzma_stream_buffer_decode(
        &memory, 0, nullptr, Bytes(bytes), &read, bytes.size(), Bytes(text), &written, text.size());
    if (end == LZMA_OK && read == bytes.size()) {
      text.resize(written);
      return text;
    }
    if (end != LZMA_BUF_ERROR || text.size() >= kMaxText) break;
    text.resize(std::min(4 * text.size(), kMaxText));
  }
  throw base::Error(fmt::format("{}: is damaged, expected a file of xz", source));
}

}  // namespace slalom::sweep
