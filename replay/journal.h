#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "base/file_lock.h"
#include "base/mutex.h"
#include "replay/journal_record.h"
#include "replay/table.h"

namespace slalom::replay {

struct JournalOptions {
  std::filesystem::path directory;
  std::int64_t segment_bytes = 64 << 20;          ///< Size at which a segment is sealed.
  std::chrono::milliseconds sync_interval{1000};  ///< Time between two syncs to the disk.
  std::chrono::milliseconds retry_interval{200};  ///< Time after a write that failed.
  env::StepShape shape;
  std::uint64_t spec_hash = 0;  ///< Hash of the observation and action spec.
};

/// Locks a journal's directory against other processes (`base::FileLock` of the file "lock").
struct JournalLock : base::FileLock {
  /// Creates the directory if it is missing. Throws `base::Error` if that fails or another process
  /// holds the lock.
  explicit JournalLock(const std::filesystem::path& directory);
};

/// One file of the journal. Its rows have numbers below `end_row`.
struct JournalSegment {
  std::filesystem::path path;
  std::int64_t end_row = 0;
  std::int64_t bytes = 0;
};

/// Returns the path of the file that keeps the priorities of the rows (`Table::PrintPriorities`).
std::filesystem::path PrioritiesPath(const std::filesystem::path& directory);

/// Returns the path of the file that says which run the rows are of (`proto::PrintIdentity`).
std::filesystem::path RunPath(const std::filesystem::path& directory);

/// Returns the path of the file that keeps the learners' cursors (`RateLimiter::PrintCursors`).
std::filesystem::path CursorsPath(const std::filesystem::path& directory);

/// Data recovered from a journal's directory.
struct Recovered {
  Table table;
  Sessions sessions;
  std::vector<JournalSegment> segments;
  std::uint64_t next_index = 1;
  std::int64_t lost_rows = 0;      ///< About how many rows were lost to damage.
  std::int64_t unsynced_rows = 0;  ///< The same for a loss of power, which leaves holes at the end.
  std::vector<std::string> notes;  ///< Damage that was found and what was done, one line each.
};

/// Reads the segments back: the table with its rows and row numbers, and the sessions. The same
/// draws then give the same samples as before.
///
/// If the writer was killed, the last record may be incomplete. It was never `written`, and is cut
/// off. If the last segment is damaged, everything from the damage on is lost. If an older segment
/// is damaged or missing, recovery restarts at the next segment whose head and state are intact,
/// and everything before that is lost; if there is no such segment, the damaged one counts as the
/// last. Damaged bytes are kept in a file NAME.damaged; intact segments that are useless without
/// them are deleted. Throws `base::Error` if a file cannot be read or cut, or is of another spec or
/// version. Requires: the lock is held.
Recovered RecoverJournal(const JournalOptions& options, const ReplayConfig& config);

/// Appends everything that a replay server accepts to segment files, and reports when it is
/// written.
///
/// A record is *written* once the kernel has it: it then survives the end of this process, however
/// that ends. After at most `sync_interval` it is synced and survives a loss of power, too. Each
/// segment begins with the state that results from all earlier records, and is begun only when
/// these are synced, so that a loss of power can tear only the last segment. Segments whose rows
/// the table has overwritten are deleted. If the disk is full or cannot be written, the journal
/// logs it, keeps everything in memory and tries again. The caller bounds that memory, as it
/// acknowledges only records that are written.
///
/// The first sync that fails ends the writing for good: nothing more is `written`, no segment is
/// begun or deleted. The system reports a lost page once, so a later sync that succeeds would prove
/// nothing. The next journal of the directory copies the last segment before it begins its own.
///
/// All calls except `written` and `status` belong to one thread. Rows are not copied: `owner` keeps
/// them alive until they are written. One thread of the journal writes, and syncs at the end of a
/// segment; another syncs in between; neither holds up the caller.
class Journal final : public RecordLog {
 public:
  /// Begins a new segment with `state`. The writing thread calls `on_written` when `written` has
  /// grown. Throws `base::Error` if the directory cannot be opened or no thread can be started.
  Journal(const JournalOptions& options, JournalLock lock, std::vector<JournalSegment> segments,
          std::uint64_t next_index, const StateRecord& state, std::function<void()> on_written);
  /// Calls `Close`.
  ~Journal() override;

  std::uint64_t Append(const SessionRecord& record) override;
  std::uint64_t Append(const ForgetRecord& record) override;
  std::uint64_t Append(const RowsRecord& record, std::shared_ptr<const void> owner) override;

  /// Whether the next records should go into a new segment.
  bool segment_full() const { return segment_bytes_ >= options_.segment_bytes; }
  /// Seals the segment and begins the next. Rows before `oldest_row` are no longer needed.
  void BeginSegment(const StateRecord& state, std::int64_t oldest_row);

  /// Replaces a file beside the segments at the next sync. If that fails, the earlier file stays;
  /// no rows are lost by it.
  void SaveBeside(const std::filesystem::path& path, std::string bytes) EXCLUDES(mutex_);

  std::uint64_t written() const override { return written_.load(std::memory_order_acquire); }

  struct Status {
    std::int64_t waiting_bytes = 0;  ///< Appended and not yet written.
    std::int64_t written_bytes = 0;  ///< Since the start.
    std::int64_t disk_bytes = 0;     ///< Size of all segments.
    int num_segments = 0;
    std::int64_t failures = 0;  ///< Attempts to write or sync that failed.
    std::string failing;        ///< Why nothing is acknowledged: a sync failed, or the last attempt
                                ///< to write. Empty if neither did.
    std::int64_t syncs = 0;
    double sync_s = 0.0;                           ///< Total time of all syncs.
    std::chrono::steady_clock::time_point synced;  ///< Start of the last sync that succeeded.
  };
  Status status() const EXCLUDES(mutex_);

  /// Writes and syncs the waiting records, and ends the threads. If writing fails now, the waiting
  /// records are dropped; they were never acknowledged.
  void Close() EXCLUDES(mutex_);

 private:
  struct Entry {
    RecordBytes bytes;
    std::shared_ptr<const void> owner;
    bool begins_segment = false;
    std::int64_t end_row = 0;     ///< Number of the next row after this record.
    std::int64_t oldest_row = 0;  ///< As in `BeginSegment`, if it begins a segment.
  };
  class File;

  std::uint64_t Push(Entry entry) EXCLUDES(mutex_);
  void WriteLoop();
  [[nodiscard]] bool WriteBatch(const std::vector<Entry>& batch);
  [[nodiscard]] bool SealSegment();
  [[nodiscard]] bool CopyLastSegment();
  /// Returns false if this sync failed or one before it did.
  [[nodiscard]] bool Sync(const File& file) EXCLUDES(syncing_, mutex_);
  [[nodiscard]] bool OpenSegment(const Entry& entry);
  [[nodiscard]] bool WriteAt(std::int64_t end, std::vector<std::span<const std::byte>> parts);
  /// Returns false if the journal is being closed.
  [[nodiscard]] bool WaitAfterFailure(const std::string& what) EXCLUDES(mutex_);
  void SyncLoop();
  void SyncOnce() EXCLUDES(mutex_);

  const JournalOptions options_;
  const JournalLock lock_;
  const std::function<void()> on_written_;

  // Used by the calling thread only.
  std::uint64_t appended_ = 0;
  std::int64_t segment_bytes_ = 0;
  std::int64_t end_row_ = 0;

  // Used by the writing thread only.
  std::shared_ptr<File> file_;  ///< Null before the first segment is begun.
  std::int64_t offset_ = 0;
  std::int64_t begun_ = 0;  ///< Offset up to which the kernel was told to start writing to disk.
  std::uint64_t next_index_;
  std::chrono::steady_clock::time_point said_;  ///< When a failure was last logged.
  std::string said_text_;  ///< Its text; a different failure is logged at once.

  std::atomic<std::uint64_t> written_{0};

  const std::unique_ptr<const File> directory_;

  base::Mutex syncing_;  ///< Held from a sync until its failure is in `sync_fault_`.
  mutable base::Mutex mutex_;
  base::CondVar queue_changed_;
  base::CondVar closing_changed_;
  std::deque<Entry> queue_ GUARDED_BY(mutex_);
  bool closing_ GUARDED_BY(mutex_) = false;
  bool writer_done_ GUARDED_BY(mutex_) = false;
  Status status_ GUARDED_BY(mutex_);            ///< Except `failing`.
  std::string write_fault_ GUARDED_BY(mutex_);  ///< Fault of the last attempt, or empty.
  std::string sync_fault_ GUARDED_BY(mutex_);   ///< The first that failed, or empty.
  std::vector<JournalSegment> segments_ GUARDED_BY(mutex_);         ///< The last is being written.
  std::vector<std::shared_ptr<File>> unsynced_ GUARDED_BY(mutex_);  ///< The last is being written.
  std::int64_t oldest_row_ GUARDED_BY(mutex_) = 0;
  std::map<std::filesystem::path, std::string> beside_
      GUARDED_BY(mutex_);  ///< To be saved at the next sync.
  bool closed_ = false;    // Used by the calling thread only.

  std::jthread writer_;
  std::jthread syncer_;
};

}  // namespace slalom::replay
