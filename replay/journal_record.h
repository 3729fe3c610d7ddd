#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "base/result.h"
#include "replay/sessions.h"

/// The records of the journal as bytes; docs/replay.md gives them one by one. What is read here may
/// be damaged in any way: nothing is believed before its checksum, and nothing is allocated beyond
/// a few times the bytes that are there.

namespace slalom::replay {

/// Where a record stands. Goes into its checksum, so that bytes of another place are no record.
struct RecordPlace {
  std::uint64_t segment = 0;
  std::uint64_t offset = 0;  ///< In the file.
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
/// Fails where the bytes are not a whole head, of whatever version.
base::Result<SegmentHead> ParseSegmentHead(std::span<const std::byte> bytes);

/// The first record of each segment: all that the records before it led to, but for rows.
struct StateRecord {
  std::int64_t first_row = 0;      ///< Number of the next row.
  std::vector<std::uint8_t> open;  ///< Per stream of the table, 1: an episode is running.
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

/// A chunk was accepted. Views only.
struct RowsRecord {
  std::uint32_t id = 0;  ///< Of the session.
  int num_rows = 0;
  int num_steps = 0;
  std::uint64_t sequence = 0;
  std::int64_t first_row = 0;       ///< Number in the table.
  std::span<const std::byte> rows;  ///< As `RowBytes`, streams counted from the session's base.
};

using Record = std::variant<StateRecord, SessionRecord, ForgetRecord, RowsRecord>;

/// A record on its way to the file: `head`, then the rows' bytes where it has some, then zeros up
/// to a multiple of 8 bytes.
struct RecordBytes {
  static constexpr std::size_t kPrefixBytes = 32;

  std::uint32_t type = 0;
  std::vector<std::byte> head;
  std::span<const std::byte> rows;

  /// Bytes in the file, prefix and zeros included.
  std::size_t size() const;
  /// What goes before `head`. Cost: a checksum of all bytes.
  std::array<std::byte, kPrefixBytes> Prefix(const RecordPlace& place) const;
};
RecordBytes PrintRecord(const StateRecord& record);
RecordBytes PrintRecord(const SessionRecord& record);
RecordBytes PrintRecord(const ForgetRecord& record);
RecordBytes PrintRecord(const RowsRecord& record);

/// What stands at the beginning of some bytes.
struct ParsedRecord {
  enum class Status {
    kWhole,
    kTorn,     ///< It goes on behind the bytes: the writer was killed.
    kDamaged,  ///< Not what was written.
  };
  Status status = Status::kDamaged;
  std::string why;       ///< Where it is damaged.
  std::size_t size = 0;  ///< Where it is whole: in the file, all included.
  std::optional<Record> record;
};

/// Requires: `bytes` starts on a multiple of 8 bytes in memory and stands at `place`.
ParsedRecord ParseRecord(std::span<const std::byte> bytes, const RecordPlace& place);

}  // namespace slalom::replay
