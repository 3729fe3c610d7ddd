#pragma once

#include <cstdint>
#include <string>
#include <thread>
#include <utility>

#include "metrics/registry.h"
#include "proto/messages.h"
#include "replay/service/server.h"
#include "tests/replay/service/rows_source.h"
#include "tests/support/held_clock.h"

namespace slalom::replay {

/// A server of rows of `kBeams`, over tcp, that runs in a thread until it goes out of scope.
/// `clock`: the thread's, if it is to be held.
class RunningServer {
 public:
  static constexpr int kBeams = 3;
  static constexpr std::uint64_t kSpecHash = 77;
  static constexpr std::uint64_t kSeed = 5;

  explicit RunningServer(const ReplayServerConfig& config = {},
                         transport::ServerSecurity security = {}, int max_connections = 64,
                         proto::RunIdentity run = {{"run.seed", "5"}},
                         const test::HeldClock* clock = nullptr)
      : registry_("replay", "replay"),
        server_(config,
                {.endpoint = "tcp://127.0.0.1:*",
                 .security = std::move(security),
                 .max_connections = max_connections,
                 .table = {.capacity = 500},
                 .shape = kBeams,
                 .spec_hash = kSpecHash,
                 .seed = kSeed,
                 .updates_per_step = 10.0,
                 .learning_starts = 8,
                 .run = std::move(run)},
                context_, registry_),
        thread_([this, clock](std::stop_token stop) {
          if (clock != nullptr) clock->Share();
          server_.Run(stop);
        }) {}

  std::string endpoint() const { return server_.endpoint(); }
  /// Its metrics, as Prometheus gets them.
  std::string Metrics() const { return registry_.Text(); }

 private:
  transport::Context context_;
  metrics::Registry registry_;
  ReplayServer server_;
  std::jthread thread_;
};

/// What such a server takes. An actor of two streams.
inline proto::Hello HelloOf(const std::string& role, const std::string& name,
                            std::uint64_t session = 0) {
  return {.role = role,
          .name = name,
          .session = session,
          .spec_hash = RunningServer::kSpecHash,
          .num_beams = RunningServer::kBeams,
          .num_streams = 2,
          .software = "test"};
}

inline proto::Insert InsertOf(const Chunk& chunk, std::uint64_t session, std::uint64_t sequence) {
  return {.session = session,
          .sequence = sequence,
          .num_rows = chunk.num_rows(),
          .num_beams = chunk.shape.num_beams,
          .num_steps = RowsSource::NumSteps(chunk),
          .oldest_version = 3,
          .newest_version = 5};
}

}  // namespace slalom::replay
