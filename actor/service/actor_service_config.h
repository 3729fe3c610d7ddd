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
      "A message is sent once it holds this many rows (or those of a batch step, if they are more) "
      "...");
    v("chunk_seconds", chunk_seconds, base::Range{0.0, 60.0}, "s",
      "... or once its first row is this old.");
    v("unacknowledged_bytes", unacknowledged_bytes, base::Range{1 << 20, 1e12}, "bytes",
      "Rows that an actor keeps while the replay server is away. When they fill this, the actor "
      "stops and waits for the server. While the server is there, no more than the actor's share "
      "of replay_server.window_bytes is kept.");
  }
};

}  // namespace slalom::actor
