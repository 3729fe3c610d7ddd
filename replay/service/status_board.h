#pragma once

#include <chrono>
#include <map>
#include <string>
#include <utility>

#include "proto/messages.h"

namespace slalom::replay {

/// What the roles last said of themselves. Thread-compatible. Memory: `proto::kMaxRoles` reports;
/// the oldest gives way.
class StatusBoard {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// A role whose last report is older counts as not connected.
  explicit StatusBoard(std::chrono::duration<double> silence) : silence_(silence) {}

  void Put(proto::Report report, Time now);
  /// All of them; the first ones by role and name where one message does not hold all.
  proto::StatusReply Reply(Time now) const;

 private:
  struct Entry {
    proto::Report report;
    Time came;
  };

  const std::chrono::duration<double> silence_;
  std::map<std::pair<std::string, std::string>, Entry> entries_;  ///< By role and name.
};

}  // namespace slalom::replay
