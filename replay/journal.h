#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "base/mutex.h"
#include "replay/journal_record.h"
#include "replay/record_log.h"
#include "replay/table.h"

namespace slalom::replay {

struct JournalOptions {
  std::filesystem::path directory;
  std::int64_t segment_bytes = 64 << 20;          ///< A segment is sealed when it has so many.
  std::chrono::milliseconds sync_interval{1000};  ///< Of what the disk itself is told to keep.
  int num_beams = 0;
  std::uint64_t spec_hash = 0;  ///< Of what is observed and commanded.
};

/// Keeps two journals off one directory for as long as it lives, however it ends. Movable.
class JournalLock {
 public:
  /// Makes the directory where it is missing. Throws `base::Error` where that fails or another
  /// process holds it.
  explicit JournalLock(const std::filesystem::path& directory);
  ~JournalLock();
  JournalLock(JournalLock&& other) noexcept;
  JournalLock& operator=(JournalLock&&) = delete;

 private:
  int fd_;
};

/// A file of rows before `end_row`.
struct JournalSegment {
  std::filesystem::path path;
  std::int64_t end_row = 0;
  std::int64_t bytes = 0;
};

/// Where the priorities of a directory's rows are, if they are kept (`Table::PrintPriorities`).
std::filesystem::path PrioritiesPath(const std::filesystem::path& directory);

/// What a directory holds.
struct Recovered {
  Table table;
  Sessions sessions;
  std::vector<JournalSegment> segments;
  std::uint64_t next_index = 1;
  std::int64_t lost_rows = 0;      ///< That damage has cost, about.
  std::vector<std::string> notes;  ///< What was found damaged and what was done, one line each.
};

/// Reads the segments back into a table with the rows, the row numbers and the sessions that the
/// records say, so that the same draws give the same samples.
///
/// Where the writer was killed the last record may be torn: it was never `written`, and is cut off.
/// Damage in the last segment costs what comes after it; damage in an older one (or a segment that
/// is missing), all before the next segment whose beginning is sound. Where there is none, the
/// damaged one counts as the last. Damaged bytes are kept beside, as NAME.damaged; sound segments
/// that are of no use without them are deleted. Throws `base::Error` where a file cannot be read
/// or cut, or is of another spec or version. Requires: the lock is held.
Recovered RecoverJournal(const JournalOptions& options, const ReplayConfig& config);

/// Appends what a replay server accepts to segment files, and tells when it is written.
///
/// A record is *written* when the kernel has it: it then outlives this process, however that ends.
/// `sync_interval` later it outlives a loss of power, too. Each segment begins with the state that
/// the records before it led to, and after those are synced, so that a loss of power tears no
/// segment but the last; those whose rows the table has overwritten are deleted. Where the disk is
/// full or fails the journal says so, tries again and keeps everything in memory meanwhile (the
/// caller bounds it: what is not written is not acknowledged).
///
/// The calls belong to one thread, but for `written` and `status`. The rows are not copied: `owner`
/// keeps them alive until they are written. One thread writes, and syncs where a segment ends;
/// another syncs, so neither holds up the caller.
class Journal final : public RecordLog {
 public:
  /// Begins a segment with this state. `on_written` is called by the writing thread when `written`
  /// has grown. Throws `base::Error` where the last of `segments` cannot be opened or no thread can
  /// be had.
  Journal(const JournalOptions& options, JournalLock lock, std::vector<JournalSegment> segments,
          std::uint64_t next_index, const StateRecord& state, std::function<void()> on_written);
  /// As `Close`.
  ~Journal() override;

  std::uint64_t Append(const SessionRecord& record) override;
  std::uint64_t Append(const ForgetRecord& record) override;
  std::uint64_t Append(const RowsRecord& record, std::shared_ptr<const void> owner) override;

  /// Whether the next records should go into a new segment.
  bool segment_full() const { return segment_bytes_ >= options_.segment_bytes; }
  /// Begins a segment. `oldest_row`: rows before it are no longer needed.
  void BeginSegment(const StateRecord& state, std::int64_t oldest_row);

  /// Replaces the file of priorities beside the segments at the next sync. Where that cannot be
  /// done the earlier file stays, which costs nobody a step.
  void SavePriorities(std::string bytes) EXCLUDES(mutex_);

  std::uint64_t written() const override { return written_.load(std::memory_order_acquire); }

  struct Status {
    std::int64_t waiting_bytes = 0;  ///< Appended and not yet written.
    std::int64_t written_bytes = 0;  ///< Since the start.
    std::int64_t disk_bytes = 0;     ///< Of all segments.
    int num_segments = 0;
    std::int64_t failures = 0;  ///< Attempts to write or sync that failed.
    bool blocked = false;       ///< The last attempt to write failed: nothing is acknowledged.
    std::string failing;        ///< Why the last attempt to write, or else to sync, failed; empty:
                                ///< neither did.
    std::int64_t syncs = 0;
    double sync_s = 0.0;                           ///< That all syncs took.
    std::chrono::steady_clock::time_point synced;  ///< When the last one began that succeeded.
  };
  Status status() const EXCLUDES(mutex_);

  /// Writes and syncs what is waiting and ends the threads. Where writing fails now, what is
  /// waiting is given up: it was never acknowledged.
  void Close() EXCLUDES(mutex_);

 private:
  struct Entry {
    RecordBytes bytes;
    std::shared_ptr<const void> owner;
    bool begins_segment = false;
    std::int64_t end_row = 0;     ///< Number of the next row after this record.
    std::int64_t oldest_row = 0;  ///< Of a record that begins a segment.
  };
  class File;

  std::uint64_t Push(Entry entry) EXCLUDES(mutex_);
  void WriteLoop();
  [[nodiscard]] bool WriteBatch(const std::vector<Entry>& batch);
  [[nodiscard]] bool SealSegment();
  [[nodiscard]] bool OpenSegment(const Entry& entry);
  [[nodiscard]] bool WriteAt(std::int64_t end, std::vector<std::span<const std::byte>> parts);
  /// False: the journal is being closed.
  [[nodiscard]] bool WaitAfterFailure(const std::string& what) EXCLUDES(mutex_);
  void SyncLoop();
  void SyncOnce() EXCLUDES(mutex_);

  const JournalOptions options_;
  const JournalLock lock_;
  const std::function<void()> on_written_;

  // Of the calling thread.
  std::uint64_t appended_ = 0;
  std::int64_t segment_bytes_ = 0;
  std::int64_t end_row_ = 0;

  // Of the writing thread.
  std::shared_ptr<File> file_;  ///< At first the last that was found; null: none was.
  std::int64_t offset_ = 0;
  std::int64_t begun_ = 0;  ///< Up to where the kernel was told to begin with the disk.
  std::uint64_t next_index_;
  std::chrono::steady_clock::time_point said_;  ///< When a failure was last logged.
  std::string said_text_;                       ///< Which: another one is logged at once.

  std::atomic<std::uint64_t> written_{0};

  mutable base::Mutex mutex_;
  base::CondVar queue_changed_;
  base::CondVar closing_changed_;
  std::deque<Entry> queue_ GUARDED_BY(mutex_);
  bool closing_ GUARDED_BY(mutex_) = false;
  bool writer_done_ GUARDED_BY(mutex_) = false;
  Status status_ GUARDED_BY(mutex_);                         ///< But for `blocked` and `failing`.
  std::string write_fault_ GUARDED_BY(mutex_);               ///< Of the last attempt; empty: none.
  std::string sync_fault_ GUARDED_BY(mutex_);                ///< Likewise.
  std::vector<JournalSegment> segments_ GUARDED_BY(mutex_);  ///< The last is being written.
  std::vector<std::shared_ptr<File>> unsynced_ GUARDED_BY(mutex_);  ///< Likewise.
  std::int64_t oldest_row_ GUARDED_BY(mutex_) = 0;
  std::string priorities_ GUARDED_BY(mutex_);  ///< To be saved; empty: nothing.
  bool closed_ = false;                        // Of the calling thread.

  std::jthread writer_;
  std::jthread syncer_;
};

}  // namespace slalom::replay
