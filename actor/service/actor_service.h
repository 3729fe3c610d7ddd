#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "actor/actor.h"
#include "actor/service/actor_metrics.h"
#include "actor/service/actor_service_config.h"
#include "actor/service/ledger.h"
#include "actor/service/outbox.h"
#include "env/agent.h"
#include "env/environment.h"
#include "metrics/registry.h"
#include "replay/chunk.h"
#include "service/policy_link.h"
#include "service/replay_link.h"
#include "transport/client.h"
#include "transport/context.h"

namespace slalom::actor {

/// Who an actor process is and where it connects to.
struct ActorIdentity {
  std::string name;                       ///< The same after a restart.
  std::filesystem::path state_directory;  ///< Of its ledger and spool; made where it is missing.
  std::uint64_t seed = 0;                 ///< Of the run; name and session are mixed in.
  std::uint64_t spec_hash = 0;
  std::string course_set;  ///< Trained on; for metrics.
  transport::ClientOptions replay;
  transport::ClientOptions learner;
};

/// The actor as a process of its own: drives, sends what happens to the replay server, and follows
/// the learner's policies.
///
/// What is not acknowledged is kept, up to a limit at which driving stops, and sent again after
/// every kind of interruption; docs/service.md tells how sessions, the ledger and the spool make
/// sure that each step is accepted once or counted as lost. Confined to the thread that made it.
class ActorService {
 public:
  /// `environments` and `agent` must outlive it; `install` gives a policy to the agent. Throws
  /// `base::Error` where the state directory is unusable.
  ActorService(const ActorServiceConfig& config, const ActorConfig& actor_config,
               ActorIdentity identity, env::BatchEnvironment& environments, env::Agent& agent,
               service::InstallPolicy install, transport::Context& context,
               metrics::Registry& registry);

  /// Works until `stop`, then sends what is left, or keeps it in the spool where the server does
  /// not take it within seconds. Throws `base::Error` where a server refuses this process for good,
  /// or another process of this name took its session.
  void Run(std::stop_token stop);

  StepAccount account() const { return ledger_.account(); }

 private:
  enum class Phase {
    kDraining,  ///< Sends the spool of the last session, under its number.
    kStarting,  ///< Has said hello for a session of its own.
    kRunning,
  };

  proto::Hello MakeHello(std::uint64_t session, int num_streams) const;
  void StartSession(std::uint64_t session);
  void Replace(std::string_view why);
  void OnWelcome(const proto::Welcome& welcome);
  void OnAck(const proto::InsertAck& ack);
  void OnRefusal(const proto::Refusal& refusal);
  void Acknowledge(std::uint64_t next_sequence);
  /// Takes what the servers sent, waiting for it no longer than `timeout`.
  void Listen(std::chrono::milliseconds timeout);
  void SendChunks();
  void Step();
  /// Puts the rows made so far into the outbox.
  void CloseChunk();
  bool ChunkIsDue() const;
  /// Why no step can be made now; null: one can.
  const char* Obstacle() const;
  bool MustWait() const;
  void SayObstacle(const char* obstacle);
  void Finish();
  proto::Report MakeReport();
  std::filesystem::path spool() const { return identity_.state_directory / "spool"; }

  const ActorServiceConfig config_;
  const ActorConfig actor_config_;
  const ActorIdentity identity_;
  env::BatchEnvironment& environments_;
  env::Agent& agent_;

  Ledger ledger_;
  Outbox outbox_;
  service::ReplayLink replay_;
  service::PolicyLink policy_;
  ActorMetrics metrics_;

  Phase phase_ = Phase::kStarting;
  LossReason reason_ = LossReason::kKilled;  ///< For what the last session has not accounted for.
  std::int64_t window_bytes_ = 0;
  int refused_in_a_row_ = 0;
  std::unique_ptr<Actor> actor_;  ///< While a session is running.
  replay::Chunk chunk_;           ///< Being filled.
  int chunk_steps_ = 0;
  std::int64_t chunk_oldest_version_ = 0;
  std::chrono::steady_clock::time_point chunk_began_;
  const char* said_obstacle_ = nullptr;
  std::int64_t reported_steps_ = 0;
  std::chrono::steady_clock::time_point reported_at_;
};

}  // namespace slalom::actor
