#include "tests/support/event_file_reader.h"

#include <algorithm>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace slalom::test {
namespace {

/// Bytes with a place in them.
class Reader {
 public:
  Reader(std::string_view bytes, std::string what) : bytes_(bytes), what_(std::move(what)) {}

  bool at_end() const { return place_ == bytes_.size(); }

  [[noreturn]] void Fail(const std::string& why) const {
    throw std::runtime_error(what_ + ", byte " + std::to_string(place_) + ": " + why);
  }
  std::string_view Take(std::size_t n) {
    if (n > bytes_.size() - place_) Fail("cut short");
    place_ += n;
    return bytes_.substr(place_ - n, n);
  }
  /// A number as this machine (little-endian) holds it.
  template <class T>
  T Number() {
    T value;
    std::memcpy(&value, Take(sizeof value).data(), sizeof value);
    return value;
  }
  std::uint64_t Varint() {
    std::uint64_t value = 0;
    for (int shift = 0;; shift += 7) {
      if (shift > 63) Fail("a number without an end");
      const auto byte = Number<std::uint8_t>();
      value |= static_cast<std::uint64_t>(byte & 127) << shift;
      if (byte < 128) return value;
    }
  }
  Reader Message(const std::string& what) { return {Take(Varint()), what_ + ", " + what}; }
  std::string String() { return std::string(Take(Varint())); }

 private:
  std::string_view bytes_;
  std::string what_;
  std::size_t place_ = 0;
};

std::uint32_t Unmask(std::uint32_t masked) {
  const std::uint32_t rotated = masked - 0xa282ead8u;
  return rotated >> 17 | rotated << 15;
}

void ParseSummary(Reader summary, std::map<std::string, float>& scalars) {
  while (!summary.at_end()) {
    if (summary.Varint() != (1 << 3 | 2)) summary.Fail("expected a value");
    Reader value = summary.Message("value");
    std::string tag;
    while (!value.at_end()) {
      switch (const auto key = value.Varint()) {
        case 1 << 3 | 2:
          tag = value.String();
          break;
        case 2 << 3 | 5:
          if (!scalars.emplace(tag, value.Number<float>()).second) value.Fail("a tag twice");
          break;
        default:
          value.Fail("key " + std::to_string(key));
      }
    }
  }
}

Event ParseEvent(Reader reader) {
  Event event;
  while (!reader.at_end()) {
    switch (const auto key = reader.Varint()) {
      case 1 << 3 | 1:
        event.wall_time = reader.Number<double>();
        break;
      case 2 << 3 | 0:
        event.step = static_cast<std::int64_t>(reader.Varint());
        break;
      case 3 << 3 | 2:
        event.file_version = reader.String();
        break;
      case 5 << 3 | 2:
        ParseSummary(reader.Message("summary"), event.scalars);
        break;
      case 7 << 3 | 2: {
        Reader session = reader.Message("session");
        if (session.Varint() != (1 << 3 | 0)) session.Fail("expected a status");
        event.session_status = static_cast<int>(session.Varint());
        break;
      }
      default:
        reader.Fail("key " + std::to_string(key));
    }
  }
  return event;
}

}  // namespace

std::uint32_t Crc32c(std::string_view bytes) {
  // x^32 + 0x1edc6f41, most significant power first; bits of a byte come lowest first.
  std::uint32_t remainder = 0xffffffffu;
  for (const char byte : bytes) {
    for (int bit = 0; bit < 8; ++bit) {
      const std::uint32_t in = static_cast<std::uint8_t>(byte) >> bit & 1u;
      const bool divide = (remainder >> 31 ^ in) != 0;
      remainder <<= 1;
      if (divide) remainder ^= 0x1edc6f41u;
    }
  }
  remainder = ~remainder;
  std::uint32_t reversed = 0;
  for (int bit = 0; bit < 32; ++bit) reversed |= (remainder >> bit & 1u) << (31 - bit);
  return reversed;
}

std::vector<Event> ReadEvents(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), {}};
  Reader reader(bytes, path.filename().string());
  std::vector<Event> events;
  while (!reader.at_end()) {
    const std::string_view length_bytes = reader.Take(8);
    std::uint64_t length = 0;
    std::memcpy(&length, length_bytes.data(), sizeof length);
    if (Unmask(reader.Number<std::uint32_t>()) != Crc32c(length_bytes)) reader.Fail("length's CRC");
    const std::string_view data = reader.Take(length);
    if (Unmask(reader.Number<std::uint32_t>()) != Crc32c(data)) reader.Fail("data's CRC");
    events.push_back(ParseEvent({data, "event " + std::to_string(events.size())}));
  }
  return events;
}

std::vector<std::filesystem::path> EventFiles(const std::filesystem::path& directory) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(directory)) {
    if (entry.path().filename().string().find("tfevents") != std::string::npos) {
      files.push_back(entry.path());
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<Event> ReadRun(const std::filesystem::path& directory) {
  std::vector<Event> kept;
  for (const auto& path : EventFiles(directory)) {
    for (Event& event : ReadEvents(path)) {
      if (event.session_status == 1) {
        std::erase_if(kept, [&event](const Event& e) { return e.step >= event.step; });
      }
      if (!event.scalars.empty()) kept.push_back(std::move(event));
    }
  }
  return kept;
}

}  // namespace slalom::test
