#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>

#include "metrics/registry.h"
#include "proto/messages.h"
#include "proto/refusal_log.h"
#include "proto/transport/context.h"
#include "proto/transport/server.h"
#include "replay/journal.h"
#include "replay/rate_limiter.h"
#include "replay/service/config.h"
#include "replay/service/insert_desk.h"
#include "replay/service/reply_sender.h"
#include "replay/service/sample_desk.h"
#include "replay/service/server_metrics.h"
#include "replay/service/status_board.h"
#include "replay/table.h"

namespace slalom::replay {

/// The replay server: takes rows from any number of actors, keeps them, and sends samples to any
/// number of learners. docs/service.md describes who sends what, docs/replay.md how rows are kept.
///
/// One thread owns the socket and the table and never waits for a peer; two more threads write and
/// sync the journal. Nothing that a peer sends ends the server, or makes it use more memory than
/// the config allows.
class ReplayServer {
 public:
  /// Reads the journal, if there is one, and binds the endpoint; peers are answered from `Run` on.
  /// Throws `base::Error` if the directory cannot be used, is in use by another server or belongs
  /// to another run, or if the endpoint cannot be bound. `context` and `registry` must outlive it.
  ReplayServer(const ReplayServerConfig& config, const ReplayServerSpec& spec,
               transport::Context& context, metrics::Registry& registry);
  ~ReplayServer();

  /// Serves until `stop`, then writes and syncs all accepted rows and sends their acknowledgements.
  /// Call it once, in any one thread. Throws `base::Error` if a system resource that it needs
  /// fails.
  void Run(std::stop_token stop);

  /// The endpoint that it listens on, with the actual port.
  const std::string& endpoint() const { return server_->endpoint(); }

 private:
  using Clock = std::chrono::steady_clock;
  using Time = Clock::time_point;

  struct Peer {
    std::string role;
    std::string name;
    std::uint64_t session = 0;
    Time heard;
    bool is_accounted = false;  ///< It has said goodbye, or its loss was told.
  };
  /// Sends replies through the server's socket.
  class SocketReplies;

  void Turn();
  void Tick(Time now);
  void Take(transport::Server::Received received, Time now);
  void Handle(const transport::PeerId& peer, const proto::Header& header, transport::Frame payload,
              Time now);
  /// Why a process may not move data here: it is of another run or spec. Empty if it may.
  std::string FindMismatch(const proto::Hello& hello) const;
  void Greet(const transport::PeerId& peer, const proto::Hello& hello, Time now);
  /// Whether the sender may send this message, by its key or, without keys, by its hello. A report
  /// must have the role and name of that hello.
  bool IsAllowed(const transport::Server::Received& received, const proto::Header& header) const;
  void Answer(const transport::PeerId& peer, const proto::Header& header);
  void AnswerStatus(const transport::PeerId& peer, Time now);
  void Refuse(const transport::PeerId& peer, const proto::Refusal& refusal);
  void NoteRefusal(const transport::PeerId& peer, proto::RefusalCode code, std::string_view text);
  void NoteLost(Peer& peer);
  void Forget(const transport::PeerId& peer);
  void ForgetSilent(Time now);
  StateRecord State() const;
  void RestorePriorities();
  void SavePriorities();
  void RestoreCursors();
  void SaveCursors();

  const ReplayServerConfig config_;
  const ReplayServerSpec spec_;
  std::optional<Table> table_;
  std::unique_ptr<transport::Server> server_;
  std::unique_ptr<Journal> journal_;  ///< Null if the table is in memory only.
  NoLog no_log_;
  std::unique_ptr<SocketReplies> replies_;
  std::optional<RateLimiter> limiter_;
  std::optional<InsertDesk> inserts_;
  std::optional<SampleDesk> samples_;
  StatusBoard board_;
  std::optional<ServerMetrics> metrics_;
  std::map<transport::PeerId, Peer> peers_;
  service::RefusalLog refusal_log_;
  const std::uint64_t id_;     ///< Identifies this start of the server, as in `proto::Welcome`.
  std::string saved_cursors_;  ///< As they were saved last.
  bool busy_ = false;          ///< The last turn left work to do.
  Time ticked_;
};

}  // namespace slalom::replay
