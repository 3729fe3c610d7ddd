#pragma once

#include <cstdint>
#include <string>

#include "base/config_field.h"
#include "replay/table.h"
#include "transport/security.h"

namespace slalom::replay {

/// Settings of a replay server.
struct ReplayServerConfig {
  std::string directory;
  double sync_interval = 1.0;
  std::int64_t segment_bytes = 64 << 20;
  std::int64_t max_ahead_steps = 4096;
  std::int64_t window_bytes = 4 << 20;
  std::int64_t max_message_bytes = 16 << 20;
  std::int64_t max_sample_bytes = 64 << 20;
  double max_messages_per_second = 20000.0;
  double priority_exponent = 0.6;
  double silence = 10.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("directory", directory,
      "Where the journal is kept, from which the table and all sessions come back after a restart. "
      "Empty: in memory only; what was acknowledged is lost with the process.");
    v("sync_interval", sync_interval, base::Range{0.01, 3600.0}, "s",
      "Between two syncs of the journal: so much may be lost with the power, nothing by a kill.");
    v("segment_bytes", segment_bytes, base::Range{65536.0, 1073741824.0}, "bytes",
      "Size at which a segment of the journal is sealed and the next begins.");
    v("max_ahead_steps", max_ahead_steps, base::Range{0, 1e12}, "steps",
      "Steps beyond those that the updates so far were due for, at which inserts are held until "
      "the "
      "learner catches up. 0: never. At least the steps of one update.");
    v("window_bytes", window_bytes, base::Range{1048576.0, 68719476736.0}, "bytes",
      "Payload of all actors together that may be sent and not yet acknowledged, shared out "
      "evenly; "
      "each has at least one message. What is on its way was made by older policies.");
    v("max_message_bytes", max_message_bytes, base::Range{65536.0, 268435456.0}, "bytes",
      "Largest message that is accepted.");
    v("max_sample_bytes", max_sample_bytes, base::Range{65536.0, 268435456.0}, "bytes",
      "Largest sample that is sent.");
    v("max_messages_per_second", max_messages_per_second, base::Range{10.0, 1e6}, "1/s",
      "Of one peer; more are refused.");
    v("priority_exponent", priority_exponent, base::Range{0.0, 1.0}, "",
      "alpha of prioritized sampling: how much priorities count, 0 being uniform.");
    v("silence", silence, base::Range{1.0, 3600.0}, "s",
      "After which a peer that sends nothing counts as gone: an actor that is gone has no share of "
      "the window, the status shows it as not connected. Inserts wait for a learner that is gone, "
      "too.");
  }
};

/// What a replay server takes from the run's config.
struct ReplayServerSpec {
  std::string endpoint;  ///< As `transport::ServerOptions`.
  transport::ServerSecurity security = {};
  ReplayConfig table = {};
  int num_beams = 720;
  std::uint64_t spec_hash = 0;  ///< Hash of the observation and action spec.
  std::uint64_t seed = 1;       ///< The run's seed; draws derive from it and the sample's cursor.
  double updates_per_step = 0.25;
  std::int64_t learning_starts = 4096;
  std::string software = "slalom";  ///< Name and version, shown to people.
};

}  // namespace slalom::replay
