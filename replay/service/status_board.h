#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <string>
#include <utility>

#include "proto/messages.h"

namespace slalom::replay {

/// The latest report of each role. Thread-compatible. Memory: at most `proto::kMaxRoles` reports
/// and a few times `kMaxBytes`; beyond that, the oldest report is dropped.
class StatusBoard {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// Limit on the size of all reports as a message holds them: about 4,096 typical reports.
  static constexpr std::size_t kMaxBytes = 4 << 20;

  /// A role whose last report is older than `silence` counts as not connected.
  explicit StatusBoard(std::chrono::duration<double> silence) : silence_(silence) {}

  void Put(proto::Report report, Time now);
  /// Returns all reports. If one message cannot hold them all, it has the first ones by role and
  /// name, and `omitted` counts the others.
  proto::StatusReply Reply(Time now) const;

 private:
  struct Entry {
    proto::Report report;
    Time came;
    std::size_t bytes = 0;
  };

  const std::chrono::duration<double> silence_;
  std::map<std::pair<std::string, std::string>, Entry> entries_;  ///< By role and name.
  std::size_t bytes_ = 0;                                         ///< Size of all entries.
};

}  // namespace slalom::replay
