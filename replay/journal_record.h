#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "base/result.h"
#include "replay/sessions.h"

/// The journal's records as bytes; docs/replay.md specifies each. Parsing expects any kind of
/// damage: it trusts no field before the checksum has matched, and allocates at most a few times
/// the size of its input.

namespace slalom::replay {

/// The position of a record. It is part of the checksum, so that bytes from another place do not
/// pass for a record.
struct RecordPlace {
  std::uint64_t segment = 0;
  std::uint64_t offset = 0;  ///< Within the segment's file.
};

/// The head of a segment file.
struct SegmentHead {
  static constexpr std::size_t kBytes = 56;
  static constexpr std::uint32_t kVersion = 1;

  std::uint32_t version = kVersion;
  int num_beams = 0;
  std::uint64_t spec_hash = 0;
  std::uint64_t index = 0;
  std::int64_t first_row = 0;
};

std::array<std::byte, SegmentHead::kBytes> PrintSegmentHead(const SegmentHead& head);
/// Parses a head of any version. Fails if the bytes are not a complete, undamaged head.
base::Result<SegmentHead> ParseSegmentHead(std::span<const std::byte> bytes);

/// The first record of each segment: the state that results from all earlier records, without rows.
struct StateRecord {
  std::int64_t first_row = 0;      ///< Number of the next row.
  std::vector<std::uint8_t> open;  ///< Per stream of the table, 1 if an episode is running.
  Sessions sessions;
};

/// A session began or ended: `Sessions::Put`.
struct SessionRecord {
  Session session;
};

/// `Sessions::Forget`.
struct ForgetRecord {
  std::uint32_t id = 0;
};

/// A chunk was accepted: `Sessions::Accept`. Views only.
struct RowsRecord {
  std::uint32_t id = 0;  ///< The session's id.
  int num_rows = 0;
  int num_steps = 0;
  std::uint64_t sequence = 0;
  std::int64_t first_row = 0;       ///< Number of the first row in the table.
  std::span<const std::byte> rows;  ///< As `RowBytes`; streams count from the session's base.
};

using Record = std::variant<StateRecord, SessionRecord, ForgetRecord, RowsRecord>;

/// A record to be written to a file: the prefix, `head`, the bytes of its rows, if any, and zeros
/// up to a multiple of 8 bytes.
struct RecordBytes {
  static constexpr std::size_t kPrefixBytes = 32;

  std::uint32_t type = 0;
  std::vector<std::byte> head;
  std::span<const std::byte> rows;

  /// Returns the size in the file in bytes, including prefix and zeros.
  std::size_t size() const;
  /// Returns the prefix. Cost: a checksum of all bytes.
  std::array<std::byte, kPrefixBytes> Prefix(const RecordPlace& place) const;
};
RecordBytes PrintRecord(const StateRecord& record);
RecordBytes PrintRecord(const SessionRecord& record);
RecordBytes PrintRecord(const ForgetRecord& record);
RecordBytes PrintRecord(const RowsRecord& record);

/// The result of parsing the record at the beginning of some bytes.
struct ParsedRecord {
  enum class Status {
    kWhole,
    kTorn,     ///< The bytes end before the record does: the writer was killed.
    kDamaged,  ///< The bytes are not those that were written.
  };
  Status status = Status::kDamaged;
  std::string why;       ///< If damaged: the reason.
  std::size_t size = 0;  ///< If whole: its size in the file, including prefix and zeros.
  std::optional<Record> record;
};

/// Requires: `bytes` starts on a multiple of 8 bytes in memory and was read from `place`.
ParsedRecord ParseRecord(std::span<const std::byte> bytes, const RecordPlace& place);

/// Keeps the changes of a replay server's state in their order. Thread-compatible; `written` may be
/// called by any thread.
class RecordLog {
 public:
  virtual ~RecordLog() = default;

  /// Each returns the position of its record. The record is safe once `written` has reached that
  /// position. `owner` keeps the bytes of the rows alive.
  virtual std::uint64_t Append(const SessionRecord& record) = 0;
  virtual std::uint64_t Append(const ForgetRecord& record) = 0;
  virtual std::uint64_t Append(const RowsRecord& record, std::shared_ptr<const void> owner) = 0;

  virtual std::uint64_t written() const = 0;
};

/// A log that keeps nothing, for a table in memory only: every record counts as safe at once.
class NoLog : public RecordLog {
 public:
  std::uint64_t Append(const SessionRecord&) override { return ++appended_; }
  std::uint64_t Append(const ForgetRecord&) override { return ++appended_; }
  std::uint64_t Append(const RowsRecord&, std::shared_ptr<const void>) override {
    return ++appended_;
  }
  std::uint64_t written() const override { return appended_; }

 private:
  std::uint64_t appended_ = 0;
};

}  // namespace slalom::replay
