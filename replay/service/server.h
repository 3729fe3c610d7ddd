#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "metrics/registry.h"
#include "proto/messages.h"
#include "replay/journal.h"
#include "replay/service/config.h"
#include "replay/service/insert_desk.h"
#include "replay/service/rate_limiter.h"
#include "replay/service/reply_sender.h"
#include "replay/service/sample_desk.h"
#include "replay/service/server_metrics.h"
#include "replay/service/status_board.h"
#include "replay/table.h"
#include "transport/context.h"
#include "transport/server.h"

namespace slalom::replay {

/// The replay server: takes rows of any number of actors, keeps them, and sends samples to any
/// number of learners. docs/service.md says who sends what, docs/replay.md how it is kept.
///
/// One thread owns the socket and the table and waits for nobody; two more write and sync the
/// journal. What a peer sends never ends it and takes no more memory than the bounds in its config.
class ReplayServer {
 public:
  /// Reads the journal, if there is one, and binds the endpoint; peers are answered from `Run` on.
  /// Throws `base::Error` where the directory cannot be used or is another server's or another
  /// run's, or the endpoint cannot be bound. `context` and `registry` must outlive it.
  ReplayServer(const ReplayServerConfig& config, const ReplayServerSpec& spec,
               transport::Context& context, metrics::Registry& registry);
  ~ReplayServer();

  /// Serves until `stop`, then writes and syncs what was taken and sends what is owed for it. Once,
  /// in any one thread. Throws `base::Error` where the system ends what it stands on.
  void Run(std::stop_token stop);

  /// Where it listens, with the port that was chosen.
  const std::string& endpoint() const { return server_->endpoint(); }

 private:
  using Clock = std::chrono::steady_clock;
  using Time = Clock::time_point;

  struct Peer {
    std::string role;
    std::string name;
    Time heard;
  };
  /// Sends replies through the server's socket.
  class SocketReplies;

  void Turn();
  void Tick(Time now);
  void Take(transport::Server::Received received, Time now);
  void Handle(const transport::PeerId& peer, const proto::Header& header, transport::Frame payload,
              Time now);
  void Greet(const transport::PeerId& peer, const proto::Hello& hello, Time now);
  /// Whether the sender may send this message: by its key, else by what it said in its hello. A
  /// report must be of the role and name of that hello.
  bool IsAllowed(const transport::Server::Received& received, const proto::Header& header) const;
  void Answer(const transport::PeerId& peer, const proto::Header& header);
  void Refuse(const transport::PeerId& peer, const proto::Refusal& refusal);
  void Forget(const transport::PeerId& peer);
  void ForgetSilent(Time now);
  StateRecord State() const;
  void RestorePriorities();
  void SavePriorities();

  const ReplayServerConfig config_;
  const ReplayServerSpec spec_;
  std::optional<Table> table_;
  std::unique_ptr<transport::Server> server_;
  std::unique_ptr<Journal> journal_;  ///< Null: in memory only.
  NoLog no_log_;
  std::unique_ptr<SocketReplies> replies_;
  std::optional<RateLimiter> limiter_;
  std::optional<InsertDesk> inserts_;
  std::optional<SampleDesk> samples_;
  StatusBoard board_;
  std::optional<ServerMetrics> metrics_;
  std::map<transport::PeerId, Peer> peers_;
  const std::uint64_t id_;  ///< Of this start, as `proto::Welcome`.
  bool busy_ = false;       ///< There is more to do than the last turn did.
  Time ticked_;
};

}  // namespace slalom::replay
