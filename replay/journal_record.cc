#include "replay/journal_record.h"

#include <algorithm>
#include <cstring>

#include "base/bytes.h"
#include "base/check.h"
#include "base/file.h"

namespace slalom::replay {
namespace {

constexpr char kMagic[8] = {'S', 'L', 'R', 'P', 'L', 'J', 'N', 'L'};
constexpr std::uint32_t kRecordMagic = 0x434a4c53;  // "SLJC"
constexpr std::uint32_t kState = 1;
constexpr std::uint32_t kSession = 2;
constexpr std::uint32_t kForget = 3;
constexpr std::uint32_t kRows = 4;
constexpr std::size_t kRowsHeadBytes = 32;
constexpr std::size_t kAlignment = 8;

std::size_t Padding(std::size_t size) { return (kAlignment - size % kAlignment) % kAlignment; }

void PutSession(const Session& s, base::ByteWriter* out) {
  out->Put(s.id);
  out->Put(s.stream_base);
  out->Put(s.num_streams);
  out->Put(static_cast<std::uint32_t>(s.ended));
  out->Put(s.number);
  out->Put(s.next_sequence);
  out->Put(s.accepted_steps);
  out->Put(s.earlier_steps);
  out->Put(s.previous_number);
  out->Put(s.previous_accepted_steps);
  out->Put(static_cast<std::uint32_t>(s.name.size()));
  out->PutText(s.name);
}

Session GetSession(base::ByteReader* in) {
  Session s;
  s.id = in->Get<std::uint32_t>();
  s.stream_base = in->Get<std::int32_t>();
  s.num_streams = in->Get<std::int32_t>();
  s.ended = in->Get<std::uint32_t>() != 0;
  s.number = in->Get<std::uint64_t>();
  s.next_sequence = in->Get<std::uint64_t>();
  s.accepted_steps = in->Get<std::int64_t>();
  s.earlier_steps = in->Get<std::int64_t>();
  s.previous_number = in->Get<std::uint64_t>();
  s.previous_accepted_steps = in->Get<std::int64_t>();
  s.name = in->GetText(in->Get<std::uint32_t>());
  return s;
}

std::optional<Record> GetState(base::ByteReader* in) {
  StateRecord state;
  state.first_row = in->Get<std::int64_t>();
  const auto accepted_steps = in->Get<std::int64_t>();
  const auto next_id = in->Get<std::uint32_t>();
  const auto num_sessions = in->Get<std::uint32_t>();
  state.sessions = Sessions::Restore(next_id, accepted_steps);
  for (std::uint32_t i = 0; i < num_sessions && !in->failed(); ++i) {
    const Session session = GetSession(in);
    if (in->failed() || !state.sessions.Put(session)) return std::nullopt;
  }
  const auto open = in->GetBytes(in->Get<std::uint32_t>());
  for (const std::byte b : open) state.open.push_back(b != std::byte{0});
  if (!in->done() || state.first_row < 0 || accepted_steps < 0 ||
      open.size() > static_cast<std::size_t>(Sessions::kMaxStreams)) {
    return std::nullopt;
  }
  return state;
}

std::optional<Record> GetRecord(std::uint32_t type, std::span<const std::byte> body) {
  base::ByteReader in(body);
  if (type == kState) return GetState(&in);
  if (type == kSession) {
    SessionRecord record{GetSession(&in)};
    if (in.done()) return record;
  }
  if (type == kForget) {
    const ForgetRecord record{in.Get<std::uint32_t>()};
    if (in.done()) return record;
  }
  if (type == kRows) {
    RowsRecord record;
    record.id = in.Get<std::uint32_t>();
    record.num_rows = in.Get<std::int32_t>();
    record.num_steps = in.Get<std::int32_t>();
    in.Get<std::uint32_t>();
    record.sequence = in.Get<std::uint64_t>();
    record.first_row = in.Get<std::int64_t>();
    if (in.failed()) return std::nullopt;
    record.rows = body.subspan(kRowsHeadBytes);
    return record;
  }
  return std::nullopt;
}

std::uint64_t SeedOf(const RecordPlace& place) { return (place.segment << 40) ^ place.offset; }

std::uint64_t ChecksumOf(std::span<const std::byte> head, std::span<const std::byte> rows) {
  return base::Checksum(rows, base::Checksum(head));
}

}  // namespace

std::array<std::byte, SegmentHead::kBytes> PrintSegmentHead(const SegmentHead& head) {
  base::ByteWriter out;
  out.PutBytes(std::as_bytes(std::span(kMagic)));
  out.Put(head.version);
  out.Put(static_cast<std::uint32_t>(head.num_beams));
  out.Put(head.spec_hash);
  out.Put(head.index);
  out.Put(head.first_row);
  out.Put(std::uint64_t{0});
  std::vector<std::byte> bytes = out.Take();
  const std::uint64_t checksum = base::Checksum(bytes);
  std::array<std::byte, SegmentHead::kBytes> result;
  SLALOM_CHECK_EQ(bytes.size() + sizeof(checksum), result.size());
  std::memcpy(result.data(), bytes.data(), result.size() - sizeof(checksum));
  std::memcpy(result.data() + bytes.size(), &checksum, sizeof(checksum));
  return result;
}

base::Result<SegmentHead> ParseSegmentHead(std::span<const std::byte> bytes) {
  if (bytes.size() < SegmentHead::kBytes) return base::Failure{"shorter than its head"};
  base::ByteReader in(bytes.first(SegmentHead::kBytes));
  const auto magic = in.GetBytes(sizeof(kMagic));
  if (std::memcmp(magic.data(), kMagic, sizeof(kMagic)) != 0) {
    return base::Failure{"it does not begin with SLRPLJNL"};
  }
  SegmentHead head;
  head.version = in.Get<std::uint32_t>();
  head.num_beams = in.Get<std::int32_t>();
  head.spec_hash = in.Get<std::uint64_t>();
  head.index = in.Get<std::uint64_t>();
  head.first_row = in.Get<std::int64_t>();
  in.Get<std::uint64_t>();
  if (in.Get<std::uint64_t>() != base::Checksum(bytes.first(SegmentHead::kBytes - 8))) {
    return base::Failure{"the checksum of its head does not match"};
  }
  if (head.num_beams < 0 || head.first_row < 0)
    return base::Failure{"its head has impossible values"};
  return head;
}

RecordBytes PrintRecord(const StateRecord& record) {
  base::ByteWriter out;
  out.Put(record.first_row);
  out.Put(record.sessions.accepted_steps());
  out.Put(record.sessions.next_id());
  out.Put(static_cast<std::uint32_t>(record.sessions.all().size()));
  for (const auto& [id, session] : record.sessions.all()) PutSession(session, &out);
  out.Put(static_cast<std::uint32_t>(record.open.size()));
  out.PutBytes(std::as_bytes(std::span(record.open)));
  return {kState, out.Take(), {}};
}

RecordBytes PrintRecord(const SessionRecord& record) {
  base::ByteWriter out;
  PutSession(record.session, &out);
  return {kSession, out.Take(), {}};
}

RecordBytes PrintRecord(const ForgetRecord& record) {
  base::ByteWriter out;
  out.Put(record.id);
  return {kForget, out.Take(), {}};
}

RecordBytes PrintRecord(const RowsRecord& record) {
  base::ByteWriter out;
  out.Put(record.id);
  out.Put(static_cast<std::int32_t>(record.num_rows));
  out.Put(static_cast<std::int32_t>(record.num_steps));
  out.Put(std::uint32_t{0});
  out.Put(record.sequence);
  out.Put(record.first_row);
  RecordBytes bytes{kRows, out.Take(), record.rows};
  SLALOM_CHECK_EQ(bytes.head.size(), kRowsHeadBytes);
  return bytes;
}

std::size_t RecordBytes::size() const {
  const std::size_t body = head.size() + rows.size();
  return kPrefixBytes + body + Padding(body);
}

std::array<std::byte, RecordBytes::kPrefixBytes> RecordBytes::Prefix(
    const RecordPlace& place) const {
  base::ByteWriter out;
  out.Put(kRecordMagic);
  out.Put(type);
  out.Put(static_cast<std::uint64_t>(head.size() + rows.size()));
  out.Put(ChecksumOf(head, rows));
  std::vector<std::byte> bytes = out.Take();
  const std::uint64_t checksum = base::Checksum(bytes, SeedOf(place));
  std::array<std::byte, kPrefixBytes> prefix;
  SLALOM_CHECK_EQ(bytes.size() + sizeof(checksum), prefix.size());
  std::memcpy(prefix.data(), bytes.data(), prefix.size() - sizeof(checksum));
  std::memcpy(prefix.data() + bytes.size(), &checksum, sizeof(checksum));
  return prefix;
}

ParsedRecord ParseRecord(std::span<const std::byte> bytes, const RecordPlace& place) {
  using Status = ParsedRecord::Status;
  const auto damaged = [](std::string_view why) {
    return ParsedRecord{Status::kDamaged, std::string(why), 0, std::nullopt};
  };
  if (bytes.size() < RecordBytes::kPrefixBytes) return {Status::kTorn, "", 0, std::nullopt};
  base::ByteReader in(bytes.first(RecordBytes::kPrefixBytes));
  const auto magic = in.Get<std::uint32_t>();
  const auto type = in.Get<std::uint32_t>();
  const auto size = in.Get<std::uint64_t>();
  const auto checksum = in.Get<std::uint64_t>();
  if (in.Get<std::uint64_t>() !=
          base::Checksum(bytes.first(RecordBytes::kPrefixBytes - 8), SeedOf(place)) ||
      magic != kRecordMagic) {
    return damaged("no record begins here");
  }
  const std::span<const std::byte> rest = bytes.subspan(RecordBytes::kPrefixBytes);
  if (size > rest.size() || Padding(size) > rest.size() - size) {
    return {Status::kTorn, "", 0, std::nullopt};
  }
  const auto body = rest.first(size);
  const auto padding = rest.subspan(size, Padding(size));
  const std::size_t head = type == kRows ? std::min(kRowsHeadBytes, body.size()) : body.size();
  if (checksum != ChecksumOf(body.first(head), body.subspan(head)) ||
      std::any_of(padding.begin(), padding.end(), [](std::byte b) { return b != std::byte{0}; })) {
    return damaged("the checksum of the record does not match");
  }
  ParsedRecord parsed{Status::kWhole, "", RecordBytes::kPrefixBytes + size + Padding(size),
                      GetRecord(type, body)};
  if (!parsed.record) return damaged("the record has impossible values");
  return parsed;
}

}  // namespace slalom::replay
