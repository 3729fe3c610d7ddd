#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/mutex.h"
#include "base/random.h"
#include "replay/journal.h"
#include "replay/table.h"

namespace slalom::replay {

/// A journal of random sessions and chunks beside a table and a book of sessions that were never
/// written anywhere: what a recovery ought to give is read off those.
class JournalScene {
 public:
  static constexpr int kBeams = 2;
  static constexpr std::uint64_t kSpecHash = 99;

  /// What a table and a book of sessions hold, as text: equal texts, equal contents. `from`: rows
  /// before it are left out.
  static std::string Describe(const Table& table, const Sessions& sessions, std::int64_t from = 0);

  /// The state after a record.
  struct Mark {
    std::uint64_t segment = 0;  ///< Number of the segment, from 0.
    std::int64_t end = 0;       ///< Of the record, in its file.
    std::string state;          ///< As `Describe`.
  };
  struct Segment {
    std::int64_t first_row = 0;
  };

  JournalScene(const std::filesystem::path& directory, std::int64_t capacity,
               std::int64_t segment_bytes, std::uint64_t seed);

  JournalOptions options() const;
  ReplayConfig config() const { return {.capacity = capacity_}; }

  /// Opens the journal over what the directory holds; what the recovery gave takes the place of
  /// table and sessions. Returns its notes.
  std::vector<std::string> Open();
  /// Appends random records.
  void Append(int count);
  /// Waits until all is written.
  void WaitWritten();
  void Close() { journal_.reset(); }

  const Journal& journal() const { return *journal_; }
  std::uint64_t appended() const { return appended_; }
  const Table& table() const { return *table_; }
  const Sessions& sessions() const { return sessions_; }
  /// Of the records since `Open`.
  const std::vector<Mark>& marks() const { return marks_; }
  const std::vector<Segment>& segments() const { return segments_; }

 private:
  void BeginSegment();
  void AppendSession();
  void AppendRows();
  void Put(const Session& session);
  void AddMark(std::size_t record_bytes);
  StateRecord State() const;

  const std::filesystem::path directory_;
  const std::int64_t capacity_;
  const std::int64_t segment_bytes_;
  base::Random random_;
  std::unique_ptr<Table> table_;
  Sessions sessions_;
  std::uint64_t appended_ = 0;
  std::int64_t offset_ = 0;
  std::vector<Mark> marks_;
  std::vector<Segment> segments_;

  base::Mutex mutex_;
  base::CondVar written_changed_;
  std::unique_ptr<Journal> journal_;
};

}  // namespace slalom::replay
