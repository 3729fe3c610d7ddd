#include "learner/run/event_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <string>

#include "base/clock.h"
#include "base/error.h"
#include "learner/run/tensorboard.pb.h"

namespace slalom::run {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kNameHead = "events.out.tfevents.";

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

/// An Event between its length and checksums.
std::string Record(std::string_view event) {
  const std::string length = LittleEndian(static_cast<std::uint64_t>(event.size()));
  std::string record = length + LittleEndian(MaskedCrc(length));
  return record.append(event).append(LittleEndian(MaskedCrc(event)));
}

/// The time now, [s], but at least one more than the newest event file's, because the clock may
/// have been set back.
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

namespace {

constexpr char kVersion[] = "brain.Event:2";

wire::TensorboardEvent MakeEvent(double wall_time, std::int64_t step) {
  wire::TensorboardEvent event;
  event.set_wall_time(wall_time);
  event.set_step(step);
  return event;
}

}  // namespace

std::string EncodeVersionEvent(double wall_time) {
  wire::TensorboardEvent event = MakeEvent(wall_time, 0);
  event.set_file_version(kVersion);
  return event.SerializeAsString();
}

std::string EncodeSessionStart(double wall_time, std::int64_t first_step) {
  wire::TensorboardEvent event = MakeEvent(wall_time, first_step);
  event.mutable_session_log()->set_status(wire::TensorboardSessionLog::START);
  return event.SerializeAsString();
}

std::string EncodeScalars(double wall_time, std::int64_t step, std::span<const Scalar> scalars) {
  wire::TensorboardEvent event = MakeEvent(wall_time, step);
  wire::TensorboardSummary& summary = *event.mutable_summary();
  for (const Scalar& scalar : scalars) {
    if (!(std::abs(scalar.value) <= std::numeric_limits<float>::max())) continue;
    wire::TensorboardSummary::Value& value = *summary.add_value();
    value.set_tag(std::string(scalar.tag));
    value.set_simple_value(static_cast<float>(scalar.value));
  }
  return event.SerializeAsString();
}

EventFile::EventFile(const fs::path& directory, std::int64_t first_step)
    : file_(directory / fmt::format("{}{:010}.slalom", kNameHead, NextSeconds(directory)),
            base::AppendFile::Mode::kMakeNew) {
  const double now = base::UnixSeconds();
  const std::string head =
      Record(EncodeVersionEvent(now)) + Record(EncodeSessionStart(now, first_step));
  if (const auto failure = file_.Append(head)) throw base::Error(failure->text);
}

std::optional<base::Failure> EventFile::Append(std::int64_t step, std::span<const Scalar> scalars) {
  return file_.Append(Record(EncodeScalars(base::UnixSeconds(), step, scalars)));
}

}  // namespace slalom::run
