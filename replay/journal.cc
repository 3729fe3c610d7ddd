#include "replay/journal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "base/machine.h"

namespace slalom::replay {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kSayInterval = std::chrono::minutes(1);
// Most buffers in one call to the kernel.
constexpr std::size_t kMaxParts = 512;
// Records that are written before `written` grows, so that acknowledgements do not wait for long.
constexpr std::size_t kMaxBatch = 64;

// Bytes after which the kernel is told to start writing to disk, so that the sync at a segment's
// end finds little left to do.
constexpr std::int64_t kWriteBackBytes = 1 << 20;

constexpr std::array<std::byte, 8> kZeros{};

}  // namespace

std::filesystem::path PrioritiesPath(const std::filesystem::path& directory) {
  return directory / "priorities";
}

std::filesystem::path RunPath(const std::filesystem::path& directory) { return directory / "run"; }

std::filesystem::path CursorsPath(const std::filesystem::path& directory) {
  return directory / "cursors";
}

/// The journal's directory, or a segment file that is being written or waits to be synced.
class Journal::File {
 public:
  File(int fd, std::filesystem::path path) : fd_(fd), path_(std::move(path)) {}
  static std::unique_ptr<const File> OfDirectory(const std::filesystem::path& path) {
    const int fd = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0) throw base::Error("{}: cannot open ({})", path.string(), std::strerror(errno));
    return std::make_unique<const File>(fd, path);
  }
  ~File() { ::close(fd_); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  int fd() const { return fd_; }
  const std::filesystem::path& path() const { return path_; }

 private:
  const int fd_;
  const std::filesystem::path path_;
};

Journal::Journal(const JournalOptions& options, JournalLock lock,
                 std::vector<JournalSegment> segments, std::uint64_t next_index,
                 const StateRecord& state, std::function<void()> on_written)
    : options_(options),
      lock_(std::move(lock)),
      on_written_(std::move(on_written)),
      next_index_(next_index),
      said_(Clock::now() - kSayInterval),
      directory_(File::OfDirectory(options_.directory)),
      segments_(std::move(segments)) {
  status_.synced = Clock::now();
  for (const JournalSegment& segment : segments_) status_.disk_bytes += segment.bytes;
  status_.num_segments = static_cast<int>(segments_.size());
  BeginSegment(state, 0);
  try {
    writer_ = base::StartThread("writing the journal", [this] { WriteLoop(); });
    syncer_ = base::StartThread("syncing the journal", [this] { SyncLoop(); });
  } catch (...) {
    Close();
    throw;
  }
}

Journal::~Journal() { Close(); }

void Journal::Close() {
  if (closed_) return;
  closed_ = true;
  {
    base::MutexLock lock(mutex_);
    closing_ = true;
    queue_changed_.NotifyAll();
    closing_changed_.NotifyAll();
  }
  if (writer_.joinable()) writer_.join();
  if (syncer_.joinable()) syncer_.join();
}

std::uint64_t Journal::Append(const SessionRecord& record) {
  return Push({.bytes = PrintRecord(record), .owner = nullptr, .end_row = end_row_});
}

std::uint64_t Journal::Append(const ForgetRecord& record) {
  return Push({.bytes = PrintRecord(record), .owner = nullptr, .end_row = end_row_});
}

std::uint64_t Journal::Append(const RowsRecord& record, std::shared_ptr<const void> owner) {
  SLALOM_CHECK_EQ(record.first_row, end_row_);
  end_row_ += record.num_rows;
  return Push({.bytes = PrintRecord(record), .owner = std::move(owner), .end_row = end_row_});
}

void Journal::BeginSegment(const StateRecord& state, std::int64_t oldest_row) {
  segment_bytes_ = SegmentHead::kBytes;
  end_row_ = state.first_row;
  Push({.bytes = PrintRecord(state),
        .owner = nullptr,
        .begins_segment = true,
        .end_row = end_row_,
        .oldest_row = oldest_row});
}

std::uint64_t Journal::Push(Entry entry) {
  const auto size = static_cast<std::int64_t>(entry.bytes.size());
  segment_bytes_ += size;
  base::MutexLock lock(mutex_);
  status_.waiting_bytes += size;
  queue_.push_back(std::move(entry));
  queue_changed_.NotifyOne();
  return ++appended_;
}

void Journal::SaveBeside(const std::filesystem::path& path, std::string bytes) {
  base::MutexLock lock(mutex_);
  beside_[path] = std::move(bytes);
}

Journal::Status Journal::status() const {
  base::MutexLock lock(mutex_);
  Status status = status_;
  status.failing = sync_fault_.empty() ? write_fault_ : sync_fault_;
  return status;
}

void Journal::WriteLoop() {
  std::vector<Entry> batch;
  for (;;) {
    batch.clear();
    {
      base::MutexLock lock(mutex_);
      while (queue_.empty() && !closing_) queue_changed_.Wait(mutex_);
      if (queue_.empty()) break;
      // A record that begins a segment starts a new batch.
      do {
        batch.push_back(std::move(queue_.front()));
        queue_.pop_front();
      } while (!queue_.empty() && batch.size() < kMaxBatch && !queue_.front().begins_segment);
    }
    if (!WriteBatch(batch)) break;
    written_.fetch_add(batch.size(), std::memory_order_release);
    on_written_();
  }
  base::MutexLock lock(mutex_);
  writer_done_ = true;
  closing_changed_.NotifyAll();
}

bool Journal::WriteBatch(const std::vector<Entry>& batch) {
  {
    base::MutexLock lock(mutex_);
    if (!sync_fault_.empty()) return false;
  }
  if (batch.front().begins_segment && !OpenSegment(batch.front())) return false;
  std::vector<std::array<std::byte, RecordBytes::kPrefixBytes>> prefixes(batch.size());
  std::vector<std::span<const std::byte>> parts;
  std::int64_t end = offset_;
  for (std::size_t i = 0; i < batch.size(); ++i) {
    const RecordBytes& record = batch[i].bytes;
    prefixes[i] = record.Prefix({next_index_ - 1, static_cast<std::uint64_t>(end)});
    const std::size_t padding =
        record.size() - prefixes[i].size() - record.head.size() - record.rows.size();
    parts.insert(parts.end(),
                 {prefixes[i], record.head, record.rows, std::span(kZeros).first(padding)});
    end += static_cast<std::int64_t>(record.size());
  }
  const std::int64_t size = end - offset_;
  if (!WriteAt(end, std::move(parts))) return false;
  if (offset_ - begun_ >= kWriteBackBytes) {
    // This is advice and may fail: `SealSegment` then waits longer.
    ::sync_file_range(file_->fd(), begun_, offset_ - begun_, SYNC_FILE_RANGE_WRITE);
    begun_ = offset_;
  }
  base::MutexLock lock(mutex_);
  status_.waiting_bytes -= size;
  status_.written_bytes += size;
  status_.disk_bytes += size;
  write_fault_.clear();
  segments_.back().end_row = batch.back().end_row;
  segments_.back().bytes = offset_;
  return true;
}

// Later segments must not survive a loss of power without this one: a recovery would begin with
// them and drop everything before.
bool Journal::SealSegment() {
  if (file_ ? !Sync(*file_) : !CopyLastSegment()) return false;
  return Sync(*directory_);
}

// A sync of the process before may have failed, whose pages a sync of the same file would pass
// over. All earlier segments were synced before this one was begun.
bool Journal::CopyLastSegment() {
  std::filesystem::path last;
  {
    base::MutexLock lock(mutex_);
    if (segments_.empty()) return true;
    last = segments_.back().path;
  }
  for (;;) {
    try {
      base::WriteFileAtomically(last, base::ReadFile(last));
      return true;
    } catch (const base::Error& error) {
      if (!WaitAfterFailure(error.what())) return false;
    }
  }
}

bool Journal::Sync(const File& file) {
  base::MutexLock one_at_a_time(syncing_);
  {
    base::MutexLock lock(mutex_);
    if (!sync_fault_.empty()) return false;
  }
  const bool is_directory = &file == directory_.get();
  const int failed = is_directory ? ::fsync(file.fd()) : ::fdatasync(file.fd());
  // EINVAL: the file system cannot sync directories.
  if (failed == 0 || (is_directory && errno == EINVAL)) return true;
  std::string fault = fmt::format(
      "{}: cannot sync ({}); nothing more is acknowledged until the replay server is "
      "started again",
      file.path().string(), std::strerror(errno));
  spdlog::error("{}; what was acknowledged since the sync before may not survive a loss of power",
                fault);
  base::MutexLock lock(mutex_);
  ++status_.failures;
  sync_fault_ = std::move(fault);
  return false;
}

bool Journal::OpenSegment(const Entry& entry) {
  if (!SealSegment()) return false;
  const std::filesystem::path path =
      options_.directory / fmt::format("journal-{:08}.log", next_index_);
  int fd = -1;
  while ((fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644)) < 0) {
    if (!WaitAfterFailure(
            fmt::format("{}: cannot create ({})", path.string(), std::strerror(errno)))) {
      return false;
    }
  }
  file_ = std::make_shared<File>(fd, path);
  offset_ = 0;
  begun_ = 0;
  const auto head = PrintSegmentHead({.num_beams = options_.shape.num_beams,
                                      .spec_hash = options_.spec_hash,
                                      .index = next_index_,
                                      .first_row = entry.end_row});
  ++next_index_;
  {
    base::MutexLock lock(mutex_);
    segments_.push_back({path, entry.end_row, 0});
    unsynced_.push_back(file_);
    oldest_row_ = std::max(oldest_row_, entry.oldest_row);
    status_.num_segments = static_cast<int>(segments_.size());
    status_.disk_bytes += static_cast<std::int64_t>(head.size());
  }
  return WriteAt(static_cast<std::int64_t>(head.size()), {head});
}

bool Journal::WriteAt(std::int64_t end, std::vector<std::span<const std::byte>> parts) {
  std::size_t next = 0;
  std::array<iovec, kMaxParts> vectors;
  while (offset_ < end) {
    int count = 0;
    for (std::size_t i = next; i < parts.size() && count < static_cast<int>(kMaxParts); ++i) {
      vectors[count++] = {const_cast<std::byte*>(parts[i].data()), parts[i].size()};
    }
    const ssize_t n = ::pwritev(file_->fd(), vectors.data(), count, offset_);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      if (!WaitAfterFailure(fmt::format("{}: cannot write ({})", file_->path().string(),
                                        std::strerror(n < 0 ? errno : ENOSPC)))) {
        return false;
      }
      continue;
    }
    offset_ += n;
    // After a partial write, continue where it stopped.
    auto rest = static_cast<std::size_t>(n);
    while (next < parts.size() && rest >= parts[next].size()) rest -= parts[next++].size();
    if (rest > 0) parts[next] = parts[next].subspan(rest);
  }
  return true;
}

bool Journal::WaitAfterFailure(const std::string& what) {
  if (const auto now = Clock::now(); now - said_ >= kSayInterval || what != said_text_) {
    said_ = now;
    said_text_ = what;
    spdlog::error("{}; nothing is acknowledged until this works again", what);
  }
  base::MutexLock lock(mutex_);
  ++status_.failures;
  write_fault_ = what;
  if (!closing_) closing_changed_.WaitFor(mutex_, options_.retry_interval);
  return !closing_;
}

void Journal::SyncLoop() {
  for (bool last = false; !last;) {
    {
      base::MutexLock lock(mutex_);
      const auto deadline = Clock::now() + options_.sync_interval;
      while (!writer_done_ && Clock::now() < deadline) {
        closing_changed_.WaitFor(mutex_, deadline - Clock::now());
      }
      last = writer_done_;
    }
    SyncOnce();
  }
}

void Journal::SyncOnce() {
  const auto begin = Clock::now();
  std::vector<std::shared_ptr<File>> files;
  std::vector<std::filesystem::path> unneeded;
  std::map<std::filesystem::path, std::string> beside;
  {
    base::MutexLock lock(mutex_);
    beside = std::exchange(beside_, {});
    files = unsynced_;
    // The last segment is never among them, as it has no successor.
    for (std::size_t i = 0; i + 1 < segments_.size(); ++i) {
      if (segments_[i].end_row <= oldest_row_) unneeded.push_back(segments_[i].path);
    }
  }
  bool synced = true;
  for (const auto& file : files) synced = synced && Sync(*file);
  for (const auto& [path, bytes] : beside) {
    try {
      base::WriteFileAtomically(path, bytes);
    } catch (const base::Error& error) {
      spdlog::warn("{}; a restart would use an older one", error.what());
    }
  }
  synced = synced && Sync(*directory_);
  if (!synced) return;
  // Segments are deleted only once the rows that replaced theirs are synced, the oldest first: a
  // recovery would take one that is left alone for the rest of a damage.
  std::size_t num_removed = 0;
  for (std::error_code error; num_removed < unneeded.size(); ++num_removed) {
    std::filesystem::remove(unneeded[num_removed], error);
    if (error) break;  // It is tried again after the next sync.
  }
  unneeded.resize(num_removed);
  base::MutexLock lock(mutex_);
  ++status_.syncs;
  status_.sync_s += std::chrono::duration<double>(Clock::now() - begin).count();
  status_.synced = begin;
  // Sealed files are finished; only the last one is still written.
  for (std::size_t i = 0; i + 1 < files.size(); ++i) std::erase(unsynced_, files[i]);
  std::int64_t gone_bytes = 0;
  std::erase_if(segments_, [&](const JournalSegment& segment) {
    const bool gone = std::find(unneeded.begin(), unneeded.end(), segment.path) != unneeded.end();
    if (gone) gone_bytes += segment.bytes;
    return gone;
  });
  status_.disk_bytes -= gone_bytes;
  status_.num_segments = static_cast<int>(segments_.size());
}

}  // namespace slalom::replay
