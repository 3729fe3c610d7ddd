#pragma once

#include <chrono>
#include <map>
#include <string_view>

#include "proto/refusal_code.h"

namespace slalom::service {

/// Logs the refusals of a server: the first of each code, and then at most one a minute, which says
/// how many there were in between. Thread-compatible.
class RefusalLog {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// `server`: "replay server". `who`: role and name of the peer, as far as they are known.
  void Note(std::string_view server, std::string_view who, proto::RefusalCode code,
            std::string_view text, Time now);

 private:
  struct Said {
    Time at;
    int unsaid = 0;  ///< Refusals since then.
  };
  std::map<proto::RefusalCode, Said> said_;
};

}  // namespace slalom::service
