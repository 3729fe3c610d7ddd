#include "metrics/event_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>

#include "base/clock.h"
#include "base/error.h"

namespace slalom::metrics {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kNameHead = "events.out.tfevents.";
constexpr std::string_view kVersion = "brain.Event:2";

// Protobuf: the fields of tensorflow.Event, Summary and SessionLog that are used here.
enum WireType : std::uint8_t { kVarint = 0, kFixed64 = 1, kBytes = 2, kFixed32 = 5 };
constexpr int kEventWallTime = 1;     // double
constexpr int kEventStep = 2;         // int64
constexpr int kEventFileVersion = 3;  // string
constexpr int kEventSummary = 5;      // Summary
constexpr int kEventSessionLog = 7;   // SessionLog
constexpr int kSummaryValue = 1;      // repeated Value
constexpr int kValueTag = 1;          // string
constexpr int kValueSimple = 2;       // float
constexpr int kSessionStatus = 1;     // enum
constexpr std::uint64_t kSessionStart = 1;

constexpr std::array<std::uint32_t, 256> MakeCrcTable() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t crc = i;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (crc & 1 ? 0x82f63b78u : 0u);
    table[i] = crc;
  }
  return table;
}
constexpr auto kCrcTable = MakeCrcTable();

/// CRC32C (Castagnoli), rotated and shifted as TFRecord files have it.
std::uint32_t MaskedCrc(std::string_view bytes) {
  std::uint32_t crc = ~0u;
  for (const char byte : bytes) {
    crc = (crc >> 8) ^ kCrcTable[(crc ^ static_cast<std::uint8_t>(byte)) & 0xff];
  }
  return std::rotr(~crc, 15) + 0xa282ead8u;
}

template <class Integer>
std::string LittleEndian(Integer value) {
  std::string bytes(sizeof value, '\0');
  for (char& byte : bytes) {
    byte = static_cast<char>(value & 0xff);
    value = static_cast<Integer>(value >> 8);
  }
  return bytes;
}

std::string Varint(std::uint64_t value) {
  std::string bytes;
  for (; value >= 0x80; value >>= 7) bytes += static_cast<char>((value & 0x7f) | 0x80);
  return bytes + static_cast<char>(value);
}

std::string Key(int field, WireType type) {
  return Varint(static_cast<std::uint64_t>(field) << 3 | type);
}

std::string Text(int field, std::string_view text) {
  return Key(field, kBytes) + Varint(text.size()) + std::string(text);
}

/// Wall time and step, with which every Event begins.
std::string BeginEvent(std::int64_t step) {
  return Key(kEventWallTime, kFixed64) +
         LittleEndian(std::bit_cast<std::uint64_t>(base::UnixSeconds())) +
         Key(kEventStep, kVarint) + Varint(static_cast<std::uint64_t>(step));
}

/// An Event between its length and checksums.
std::string Record(std::string_view event) {
  const std::string length = LittleEndian(static_cast<std::uint64_t>(event.size()));
  std::string record = length + LittleEndian(MaskedCrc(length));
  return record.append(event).append(LittleEndian(MaskedCrc(event)));
}

/// The time now, [s], but at least one more than that of the newest event file, because the clock
/// may have been set back.
std::int64_t NextSeconds(const fs::path& directory) {
  auto seconds = static_cast<std::int64_t>(base::UnixSeconds());
  std::error_code error;
  for (fs::directory_iterator it(directory, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (!name.starts_with(kNameHead)) continue;
    std::int64_t taken = 0;
    std::from_chars(name.data() + kNameHead.size(), name.data() + name.size(), taken);
    seconds = std::max(seconds, taken + 1);
  }
  return seconds;
}

}  // namespace

EventFile::EventFile(const fs::path& directory, std::int64_t first_step)
    : file_(directory / fmt::format("{}{:010}.slalom", kNameHead, NextSeconds(directory)),
            base::AppendFile::Mode::kMakeNew) {
  const std::string head =
      Record(BeginEvent(0) + Text(kEventFileVersion, kVersion)) +
      Record(BeginEvent(first_step) +
             Text(kEventSessionLog, Key(kSessionStatus, kVarint) + Varint(kSessionStart)));
  if (const auto failure = file_.Append(head)) throw base::Error(failure->text);
}

std::optional<base::Failure> EventFile::Append(std::int64_t step, std::span<const Scalar> scalars) {
  std::string summary;
  for (const Scalar& scalar : scalars) {
    if (!(std::abs(scalar.value) <= std::numeric_limits<float>::max())) continue;
    const auto value = static_cast<float>(scalar.value);
    summary += Text(kSummaryValue, Text(kValueTag, scalar.tag) + Key(kValueSimple, kFixed32) +
                                       LittleEndian(std::bit_cast<std::uint32_t>(value)));
  }
  return file_.Append(Record(BeginEvent(step) + Text(kEventSummary, summary)));
}

}  // namespace slalom::metrics
