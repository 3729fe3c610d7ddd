#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <tuple>
#include <variant>
#include <vector>

#include "replay/journal_record.h"
#include "replay/rows.h"
#include "replay/table.h"

namespace slalom::replay {

/// A log in memory that the test writes: a crash keeps what was written, and perhaps some more.
class FakeLog : public RecordLog {
 public:
  std::uint64_t Append(const SessionRecord& record) override { return Add(record, {}); }
  std::uint64_t Append(const ForgetRecord& record) override { return Add(record, {}); }
  std::uint64_t Append(const RowsRecord& record, std::shared_ptr<const void>) override {
    std::vector<std::uint64_t> copy(record.rows.size() / 8 + 1);
    const auto bytes = std::as_writable_bytes(std::span(copy)).first(record.rows.size());
    std::copy(record.rows.begin(), record.rows.end(), bytes.begin());
    RowsRecord kept = record;
    kept.rows = bytes;
    return Add(kept, std::move(copy));
  }
  std::uint64_t written() const override { return written_; }

  std::uint64_t appended() const { return entries_.size(); }
  void Write(std::uint64_t count) { written_ = std::min(appended(), written_ + count); }
  void WriteAll() { written_ = appended(); }
  /// Ends as a process does that is killed: `more` records beyond those written happen to be there.
  void Crash(std::uint64_t more) {
    Write(more);
    entries_.resize(written_);
  }

  /// What the records lead to. Every one of them must follow on those before it.
  void Replay(Table* table, Sessions* sessions) const {
    for (const Entry& entry : entries_) {
      if (const auto* session = std::get_if<SessionRecord>(&entry.record)) {
        const auto freed = sessions->Put(session->session);
        SLALOM_CHECK(freed.ok());
        for (int s = freed->base; s < freed->base + freed->count; ++s) table->Cut(s);
      } else if (const auto* forget = std::get_if<ForgetRecord>(&entry.record)) {
        SLALOM_CHECK(sessions->Forget(forget->id));
      } else if (const auto* rows = std::get_if<RowsRecord>(&entry.record)) {
        const Session& of = *sessions->Find(rows->id);
        SLALOM_CHECK_EQ(rows->first_row, table->total_inserted());
        SLALOM_CHECK(!sessions->Accept(rows->id, rows->sequence, rows->num_steps));
        const auto parsed =
            RowBytes::Parse(rows->rows, rows->num_rows, table->shape(), of.num_streams);
        SLALOM_CHECK(parsed.ok());
        SLALOM_CHECK(!table->CheckEpisodes(*parsed, of.stream_base));
        table->InsertRows(*parsed, of.stream_base);
      }
    }
  }

  /// The chunks that are there: name, session, sequence. Each at most once.
  std::set<std::tuple<std::string, std::uint64_t, std::uint64_t>> Chunks() const {
    std::set<std::tuple<std::string, std::uint64_t, std::uint64_t>> chunks;
    std::map<std::uint32_t, Session> sessions;
    for (const Entry& entry : entries_) {
      if (const auto* session = std::get_if<SessionRecord>(&entry.record)) {
        sessions[session->session.id] = session->session;
      } else if (const auto* rows = std::get_if<RowsRecord>(&entry.record)) {
        const Session& of = sessions.at(rows->id);
        SLALOM_CHECK(chunks.emplace(of.name, of.number, rows->sequence).second);
      }
    }
    return chunks;
  }

 private:
  struct Entry {
    Record record;
    std::vector<std::uint64_t> bytes;
  };

  std::uint64_t Add(Record record, std::vector<std::uint64_t> bytes) {
    entries_.push_back({std::move(record), std::move(bytes)});
    return appended();
  }

  std::vector<Entry> entries_;
  std::uint64_t written_ = 0;
};

}  // namespace slalom::replay
