#pragma once

#include <cstdint>
#include <string>

#include "base/config_field.h"
#include "proto/run_identity.h"
#include "proto/transport/security.h"
#include "replay/table.h"

namespace slalom::replay {

/// Settings of a replay server.
struct ReplayServerConfig {
  std::string directory;
  double sync_interval = 1.0;
  std::int64_t segment_bytes = 64 << 20;
  std::int64_t max_ahead_steps = 4096;
  std::int64_t window_bytes = 4 << 20;
  std::int64_t unwritten_bytes = 64 << 20;
  std::int64_t max_message_bytes = 16 << 20;
  std::int64_t max_sample_bytes = 64 << 20;
  double max_messages_per_second = 20000.0;
  double priority_exponent = 0.6;
  double silence = 10.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("directory", directory,
      "Directory of the journal, from which the table and all sessions are restored after a "
      "restart. Empty: replay/ below service.state.");
    v("sync_interval", sync_interval, base::Range{0.01, 3600.0}, "s",
      "Time between two syncs of the journal. If the power fails, the rows of this time may be "
      "lost; if the process is killed, none.");
    v("segment_bytes", segment_bytes, base::Range{65536.0, 1073741824.0}, "bytes",
      "Size at which a segment of the journal is sealed and the next begins.");
    v("max_ahead_steps", max_ahead_steps, base::Range{0, 1e12}, "steps",
      "Steps by which inserts may run ahead of the learner's updates; further ones are held until "
      "it catches up. Less than the steps of one update counts as these. 0: inserts are never "
      "held.");
    v("window_bytes", window_bytes, base::Range{4096.0, 68719476736.0}, "bytes",
      "Flow-control window: the payload that all actors together may have sent without an "
      "acknowledgement. Each actor has an equal share, at least one message. With a larger window, "
      "rows come from older policies.");
    v("unwritten_bytes", unwritten_bytes, base::Range{1048576.0, 68719476736.0}, "bytes",
      "Payload that the server keeps before it is written: held by the rate limiter, or on its way "
      "to the disk. If it has no room for a message of each actor, the actors are granted room in "
      "turn. Less than max_message_bytes counts as that.");
    v("max_message_bytes", max_message_bytes, base::Range{65536.0, 268435456.0}, "bytes",
      "Largest message that is accepted.");
    v("max_sample_bytes", max_sample_bytes, base::Range{65536.0, 268435456.0}, "bytes",
      "Largest sample that is sent.");
    v("max_messages_per_second", max_messages_per_second, base::Range{10.0, 1e6}, "1/s",
      "Messages accepted from one peer; more are refused.");
    v("priority_exponent", priority_exponent, base::Range{0.0, 1.0}, "",
      "Exponent alpha of prioritized sampling: how much priorities count. 0: sampling is uniform.",
      base::ReadIf{"learner.prioritized"});
    v("silence", silence, base::Range{1.0, 3600.0}, "s",
      "A peer that sends nothing for this long counts as gone: the status shows it as not "
      "connected, and an actor loses its share of the window. Inserts still wait for a learner "
      "that is gone.");
  }
};

/// The parts of the run's config that a replay server needs.
struct ReplayServerSpec {
  std::string name = "replay";  ///< In its reports.
  std::string endpoint;         ///< As `transport::ServerOptions`.
  transport::ServerSecurity security = {};
  int max_connections = 4096;  ///< As `transport::ServerOptions`.
  ReplayConfig table = {};
  env::StepShape shape = 720;
  std::uint64_t spec_hash = 0;  ///< Hash of the observation and action spec.
  std::uint64_t seed = 1;       ///< The run's seed; draws derive from it and the sample's cursor.
  double updates_per_step = 0.25;
  int batches_per_update = 1;
  std::int64_t chunk_bytes = 64 << 10;  ///< Size of a full chunk of the run's actors.
  std::int64_t learning_starts = 4096;
  std::string software = "slalom";  ///< Name and version, shown to people.
  proto::RunIdentity run = {};      ///< Actors and learners of another run are refused.
};

}  // namespace slalom::replay
