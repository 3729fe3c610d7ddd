#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <string>
#include <utility>

#include "proto/messages.h"

namespace slalom::replay {

/// What the roles last said of themselves. Thread-compatible. Memory: `proto::kMaxRoles` reports,
/// and a few times `kMaxBytes`; the oldest gives way.
class StatusBoard {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// Of all reports, as a message would hold them: some 4,096 of those that the roles send.
  static constexpr std::size_t kMaxBytes = 4 << 20;

  /// A role whose last report is older counts as not connected.
  explicit StatusBoard(std::chrono::duration<double> silence) : silence_(silence) {}

  void Put(proto::Report report, Time now);
  /// All of them; the first ones by role and name where one message does not hold all, the others
  /// being counted in `omitted`.
  proto::StatusReply Reply(Time now) const;

 private:
  struct Entry {
    proto::Report report;
    Time came;
    std::size_t bytes = 0;
  };

  const std::chrono::duration<double> silence_;
  std::map<std::pair<std::string, std::string>, Entry> entries_;  ///< By role and name.
  std::size_t bytes_ = 0;                                         ///< Of all entries.
};

}  // namespace slalom::replay
