#pragma once

#include <cstdint>
#include <memory>

#include "replay/journal_record.h"

namespace slalom::replay {

/// Where the changes of a replay server's state are kept, in their order. Thread-compatible, but
/// for `written`.
class RecordLog {
 public:
  virtual ~RecordLog() = default;

  /// Each returns the position of its record: it is safe when `written` is not less. `owner` keeps
  /// the bytes of the rows alive.
  virtual std::uint64_t Append(const SessionRecord& record) = 0;
  virtual std::uint64_t Append(const ForgetRecord& record) = 0;
  virtual std::uint64_t Append(const RowsRecord& record, std::shared_ptr<const void> owner) = 0;

  virtual std::uint64_t written() const = 0;
};

/// Keeps nothing, for a table that lives in memory only: what is appended counts as safe at once.
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
