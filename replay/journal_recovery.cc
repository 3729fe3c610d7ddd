#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "base/split.h"
#include "replay/journal.h"
#include "replay/lazy_memory.h"
#include "replay/rows.h"

namespace slalom::replay {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = "journal-";
constexpr std::string_view kSuffix = ".log";

/// Returns the number in a segment's file name, or nothing if it is not a segment's name.
std::optional<std::uint64_t> IndexOf(const std::string& name) {
  if (!name.starts_with(kPrefix) || !name.ends_with(kSuffix)) return std::nullopt;
  const std::size_t affixes = kPrefix.size() + kSuffix.size();
  return base::ParseNumber<std::uint64_t>(
      std::string_view(name).substr(kPrefix.size(), name.size() - affixes));
}

std::vector<std::pair<std::uint64_t, fs::path>> ListSegments(const fs::path& directory) {
  std::vector<std::pair<std::uint64_t, fs::path>> segments;
  std::error_code error;
  for (fs::directory_iterator it(directory, error), end; !error && it != end; it.increment(error)) {
    if (const auto index = IndexOf(it->path().filename().string())) {
      segments.emplace_back(*index, it->path());
    }
  }
  if (error) throw base::Error("{}: cannot list: {}", directory.string(), error.message());
  std::sort(segments.begin(), segments.end());
  return segments;
}

void ReadWhole(const fs::path& path, AlignedBuffer<std::byte>* content) {
  std::ifstream in(path, std::ios::binary);
  std::error_code error;
  const auto size = fs::file_size(path, error);
  if (in && !error) {
    content->Resize(size);
    in.read(reinterpret_cast<char*>(content->data()), static_cast<std::streamsize>(size));
  }
  base::ThrowIf(
      !in || error,
      "{}: cannot read this segment of the replay journal; move it away to start without it",
      path.string());
}

fs::path DamagedPath(const fs::path& path) { return path.string() + ".damaged"; }

/// Throws if the head is complete but of another version or spec.
void CheckHead(const JournalOptions& options, const fs::path& path, const SegmentHead& head) {
  base::ThrowIf(head.version != SegmentHead::kVersion,
                "{}: this replay journal is of version {}, expected {}", path.string(),
                head.version, SegmentHead::kVersion);
  base::ThrowIf(
      head.num_beams != options.shape.num_beams || head.spec_hash != options.spec_hash,
      "{}: this replay journal holds {} beams and spec {:016x}, expected {} and {:016x}: it "
      "belongs to another run; choose another directory",
      path.string(), head.num_beams, head.spec_hash, options.shape.num_beams, options.spec_hash);
}

/// Whether recovery can begin with this segment: its head and its state record are intact.
bool BeginsSoundly(std::uint64_t index, std::span<const std::byte> content) {
  const auto head = ParseSegmentHead(content);
  if (!head || head->index != index) return false;
  const ParsedRecord first =
      ParseRecord(content.subspan(SegmentHead::kBytes), {index, SegmentHead::kBytes});
  return first.record && std::holds_alternative<StateRecord>(*first.record);
}

/// Whether recovery can begin with any of these segments. Throws as `CheckHead`. Cost: reads them.
bool AnyBeginsSoundly(const JournalOptions& options,
                      std::span<const std::pair<std::uint64_t, fs::path>> segments) {
  AlignedBuffer<std::byte> content;
  return std::ranges::any_of(segments, [&](const auto& segment) {
    ReadWhole(segment.second, &content);
    const std::span<const std::byte> bytes(content.data(), content.size());
    if (const auto head = ParseSegmentHead(bytes)) CheckHead(options, segment.second, *head);
    return BeginsSoundly(segment.first, bytes);
  });
}

/// Whether the bytes from `offset` on have a hole, as a loss of power leaves for what was written
/// and not synced: they are zeros, or a sector is.
bool HasHole(std::span<const std::byte> content, std::size_t offset) {
  constexpr std::size_t kSector = 512;
  const auto is_zero = [](std::span<const std::byte> bytes) {
    return std::ranges::all_of(bytes, [](std::byte b) { return b == std::byte{0}; });
  };
  if (is_zero(content.subspan(offset))) return true;
  for (std::size_t at = (offset + kSector - 1) / kSector * kSector; at + kSector <= content.size();
       at += kSector) {
    if (is_zero(content.subspan(at, kSector))) return true;
  }
  return false;
}

/// Truncates a segment at `offset`. If `keep`, the rest is in a synced file beside it before that.
void CutAt(const fs::path& path, std::span<const std::byte> content, std::size_t offset,
           bool keep) {
  if (keep) {
    const auto rest = content.subspan(offset);
    base::WriteFileAtomically(DamagedPath(path),
                              {reinterpret_cast<const char*>(rest.data()), rest.size()});
  }
  const int failed =
      offset == 0 ? ::unlink(path.c_str()) : ::truncate(path.c_str(), static_cast<off_t>(offset));
  if (failed) {
    throw base::Error("{}: cannot truncate the journal at byte {} ({})", path.string(), offset,
                      std::strerror(errno));
  }
}

/// Applies the records of one segment after the other to a table and sessions.
class Replayer {
 public:
  Replayer(const JournalOptions& options, const ReplayConfig& config)
      : options_(options), config_(config), table_(Table::BeginRestore(config, options.shape, 0)) {}

  /// How far the records of a segment could be applied.
  struct End {
    std::size_t offset = 0;  ///< End of the last good record; 0 if there is none.
    bool torn = false;
    std::string damage;  ///< Empty if there is none.
    bool gap = false;    ///< Rows before it are missing; nothing was applied.
  };

  End Follow(std::uint64_t index, const fs::path& path, std::span<const std::byte> content) {
    End end;
    end.torn = content.size() < SegmentHead::kBytes;
    if (end.torn) return end;
    const auto head = ParseSegmentHead(content);
    if (!head) end.damage = head.failure().text;
    if (head) CheckHead(options_, path, *head);
    if (head && head->index != index)
      end.damage = "its name does not match the segment number in its head";
    if (!end.damage.empty()) return end;
    end.gap = started_ && head->first_row != next_row() && BeginsSoundly(index, content);
    if (end.gap) return end;
    for (std::size_t offset = SegmentHead::kBytes; end.offset < content.size();
         end.offset = offset) {
      ParsedRecord parsed = ParseRecord(content.subspan(offset), {index, offset});
      end.torn = parsed.status == ParsedRecord::Status::kTorn;
      if (parsed.status == ParsedRecord::Status::kDamaged) end.damage = parsed.why;
      if (parsed.status == ParsedRecord::Status::kWhole) {
        if (auto why = Apply(std::move(*parsed.record), end.offset == 0)) {
          end.damage = std::move(*why);
        }
      }
      if (end.torn || !end.damage.empty()) return end;
      offset += parsed.size;
    }
    return end;
  }

  /// Discards everything applied so far and returns the number of lost rows. The next segment
  /// starts again.
  std::int64_t Drop() {
    const std::int64_t rows = table_.num_rows();
    table_ = Table::BeginRestore(config_, options_.shape, 0);
    sessions_ = Sessions();
    open_.clear();
    started_ = false;
    return rows;
  }

  std::int64_t next_row() const { return table_.total_inserted(); }

  Table TakeTable() {
    table_.FinishRestore(open_);
    return std::move(table_);
  }
  Sessions TakeSessions() { return std::move(sessions_); }

 private:
  std::optional<std::string> Apply(Record record, bool first) {
    if (first != std::holds_alternative<StateRecord>(record)) {
      return "a state record is missing or out of place";
    }
    return std::visit([this](auto&& r) { return Do(std::forward<decltype(r)>(r)); },
                      std::move(record));
  }

  std::optional<std::string> Do(StateRecord state) {
    if (started_ && state.first_row != next_row()) {
      return fmt::format("it begins with row {}, expected {}", state.first_row, next_row());
    }
    if (!started_) {
      table_ = Table::BeginRestore(config_, options_.shape, state.first_row);
      open_ = std::move(state.open);
    }
    sessions_ = std::move(state.sessions);
    started_ = true;
    return std::nullopt;
  }

  std::optional<std::string> Do(const SessionRecord& record) {
    const auto freed = sessions_.Put(record.session);
    if (!freed) return freed.failure().text;
    for (int s = freed->base; s < freed->base + freed->count; ++s) {
      table_.Cut(s);
      if (static_cast<std::size_t>(s) < open_.size()) open_[s] = 0;
    }
    return std::nullopt;
  }

  std::optional<std::string> Do(const ForgetRecord& record) {
    if (sessions_.Forget(record.id)) return std::nullopt;
    return fmt::format("id {} has no ended session", record.id);
  }

  std::optional<std::string> Do(const RowsRecord& record) {
    const Session* const session = sessions_.Find(record.id);
    if (session == nullptr) return fmt::format("it holds rows of the unknown id {}", record.id);
    const auto rows =
        RowBytes::Parse(record.rows, record.num_rows, options_.shape, session->num_streams);
    if (!rows) return rows.failure().text;
    if (record.first_row != next_row()) {
      return fmt::format("found row {}, expected {}", record.first_row, next_row());
    }
    const int base = session->stream_base;
    if (const auto failure = sessions_.Accept(record.id, record.sequence, record.num_steps)) {
      return failure->text;
    }
    const auto end =
        static_cast<std::size_t>(base) + static_cast<std::size_t>(session->num_streams);
    if (open_.size() < end) open_.resize(end, 0);
    for (int r = 0; r < rows->num_rows(); ++r) {
      const RowView row = rows->row(r);
      open_[base + row.stream] = !(row.flags & kRowFinal);
    }
    table_.InsertRows(*rows, base);
    return std::nullopt;
  }

  const JournalOptions& options_;
  const ReplayConfig config_;
  Table table_;
  Sessions sessions_;
  std::vector<std::uint8_t> open_;
  bool started_ = false;
};

fs::path LockFile(const fs::path& directory) {
  base::MakeDirectories(directory);
  return directory / "lock";
}

}  // namespace

JournalLock::JournalLock(const fs::path& directory)
    : FileLock(OfFile(LockFile(directory), "another replay server uses this directory")) {}

Recovered RecoverJournal(const JournalOptions& options, const ReplayConfig& config) {
  base::RemoveUnfinishedFiles(options.directory);
  const auto listed = ListSegments(options.directory);
  Replayer replayer(options, config);
  std::vector<JournalSegment> segments;
  std::int64_t lost_rows = 0;
  std::int64_t unsynced_rows = 0;
  std::vector<std::string> notes;
  const auto row_bytes = static_cast<std::int64_t>(RowBytes::Size(1, options.shape));
  // The segments so far are useless, as the next one does not continue them.
  const auto drop = [&] {
    lost_rows += replayer.Drop();
    for (const JournalSegment& segment : segments) {
      base::Rename(segment.path, segment.path.string() + ".unused");
    }
    segments.clear();
  };
  AlignedBuffer<std::byte> content;
  for (std::size_t i = 0; i < listed.size(); ++i) {
    const auto& [index, path] = listed[i];
    ReadWhole(path, &content);
    const std::span<const std::byte> bytes(content.data(), content.size());
    Replayer::End end = replayer.Follow(index, path, bytes);
    if (end.gap) {
      notes.push_back(fmt::format(
          "{}: rows before this segment are missing; the table begins with it, and the segments "
          "before it are kept as .unused",
          path.string()));
      drop();
      end = replayer.Follow(index, path, bytes);
    }
    const std::string why = end.torn ? "the last record is incomplete" : end.damage;
    const auto behind = static_cast<std::int64_t>(content.size() - end.offset);
    if (!why.empty() && AnyBeginsSoundly(options, std::span(listed).subspan(i + 1))) {
      notes.push_back(fmt::format(
          "{}: damaged at byte {}: {}; kept as {}; the table begins with a later segment, and "
          "the segments before it are kept as .unused",
          path.string(), end.offset, why, DamagedPath(path).filename().string()));
      drop();
      lost_rows += behind / row_bytes;
      base::Rename(path, DamagedPath(path));
      continue;
    }
    if (!why.empty()) {
      // A killed writer can only tear the very last record, which it never reported as written.
      const bool killed = end.torn && i + 1 == listed.size();
      const bool keep = !killed && behind > 0;
      const bool hole = keep && HasHole(bytes, end.offset);
      notes.push_back(fmt::format(
          "{}: at byte {}: {}{}; the {} bytes from there on are cut off{}", path.string(),
          end.offset, why, hole ? " (a hole, as a loss of power leaves)" : "", behind,
          keep ? ", kept as " + DamagedPath(path).filename().string() : ""));
      CutAt(path, bytes, end.offset, keep);
      if (!killed) (hole ? unsynced_rows : lost_rows) += behind / row_bytes;
    }
    if (end.offset == 0) continue;
    segments.push_back({path, replayer.next_row(), static_cast<std::int64_t>(end.offset)});
  }
  return {replayer.TakeTable(),
          replayer.TakeSessions(),
          std::move(segments),
          listed.empty() ? 1 : listed.back().first + 1,
          lost_rows,
          unsynced_rows,
          std::move(notes)};
}

}  // namespace slalom::replay
