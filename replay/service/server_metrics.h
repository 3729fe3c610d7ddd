#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string_view>
#include <vector>

#include "metrics/registry.h"
#include "proto/messages.h"
#include "proto/transport/server.h"
#include "replay/journal.h"
#include "replay/rate_limiter.h"
#include "replay/service/config.h"
#include "replay/service/insert_desk.h"
#include "replay/service/sample_desk.h"
#include "replay/table.h"

namespace slalom::replay {

/// The metrics of a replay server, for Prometheus and for its own report. Confined to the server's
/// thread.
class ServerMetrics {
 public:
  using Time = std::chrono::steady_clock::time_point;

  ServerMetrics(metrics::Registry& registry, const ReplayServerSpec& spec);

  /// Shows the data that this start recovered from disk.
  void ShowRecovery(const Recovered& recovered);
  /// Counts a message that was decoded.
  void CountMessage(const proto::Header& header) { messages_[header.index()].Increment(); }
  void CountRefusal(proto::RefusalCode code);
  void CountLostPeer(const std::string& role);
  /// Notes that the server's loop turns.
  void CountTurn() { registry_.Beat(); }

  /// The sources of the metrics. Only `journal` may be null.
  struct Sources {
    const Table* table = nullptr;
    const RateLimiter* limiter = nullptr;
    InsertDesk* inserts = nullptr;
    SampleDesk* samples = nullptr;
    const Journal* journal = nullptr;
    std::int64_t malformed = 0;
    transport::Server::Connections connections;
    std::map<std::string_view, int> peers;  ///< Number of peers heard from lately, by role.
    double held_inserts_s = 0.0;            ///< Time since the last call with inserts held, [s].
    double held_samples_s = 0.0;            ///< The same for samples, [s].
  };
  /// Updates all metrics. To be called about once a second.
  void Show(const Sources& sources, Time now);
  /// The metrics of the last `Show` as this role's report.
  const proto::Report& report() const { return report_; }

 private:
  void ShowJournal(const Journal::Status& status);

  metrics::Registry& registry_;
  const ReplayServerSpec& spec_;
  std::vector<metrics::Counter> messages_, refusals_;  // By kind, and by code.

  Time shown_;
  std::int64_t shown_steps_ = 0;
  std::int64_t shown_batches_ = 0;
  std::int64_t shown_syncs_ = 0;
  double shown_sync_s_ = 0.0;
  proto::Report report_;
};

}  // namespace slalom::replay
