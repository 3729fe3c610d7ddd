#pragma once

#include <cstdint>

#include "base/config_field.h"

namespace slalom::actor {

/// How an actor process sends its rows.
struct ActorServiceConfig {
  int chunk_rows = 256;
  double chunk_seconds = 0.2;
  std::int64_t unacknowledged_bytes = 64 << 20;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("chunk_rows", chunk_rows, base::Range{1, 16384}, "rows",
      "A message is sent when it holds so many rows (or a batch step's, if those are more) ...");
    v("chunk_seconds", chunk_seconds, base::Range{0.0, 60.0}, "s",
      "... or when its first row is so old.");
    v("unacknowledged_bytes", unacknowledged_bytes, base::Range{1 << 20, 1e12}, "bytes",
      "Rows kept while the replay server is away; when so many wait, the actor stops and waits. "
      "While it is there, no more than its window (replay_server.window_bytes) waits.");
  }
};

}  // namespace slalom::actor
