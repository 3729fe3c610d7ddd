#pragma once

#include <cstdint>
#include <memory>

#include "replay/journal_record.h"

namespace slalom::replay {

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
