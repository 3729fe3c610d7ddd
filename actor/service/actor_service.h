#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
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
#include "proto/policy_link.h"
#include "proto/replay_link.h"
#include "proto/transport/client.h"
#include "proto/transport/context.h"
#include "replay/chunk.h"

namespace slalom::actor {

/// The identity of an actor process and the servers it connects to.
struct ActorIdentity {
  std::string name;                       ///< The same after a restart.
  std::filesystem::path state_directory;  ///< Holds ledger and spool; created if missing.
  std::uint64_t seed = 0;                 ///< The run's seed; name and session are mixed in.
  std::uint64_t spec_hash = 0;
  proto::RunIdentity run;
  std::string course_set;  ///< The course set trained on, for metrics.
  bool plans = false;      ///< Whether it needs policies with their transition model.
  transport::ClientOptions replay;
  transport::ClientOptions learner;
};

/// The actor as a process of its own: drives, sends its rows to the replay server, and installs the
/// learner's newest policy.
///
/// Unacknowledged chunks are kept and sent again after every kind of interruption; at a limit the
/// actor stops driving. docs/service.md explains how sessions, the ledger and the spool make sure
/// that each step is either accepted once or counted as lost. Confined to the thread that made it.
class ActorService {
 public:
  /// `environments` and `agent` must outlive the service; `install` gives a policy to the agent.
  /// Throws `base::Error` if the state directory is unusable.
  ActorService(const ActorServiceConfig& config, const ActorConfig& actor_config,
               const SamplingConfig& sampling, ActorIdentity identity,
               env::BatchEnvironment& environments, env::Agent& agent,
               service::InstallPolicy install, transport::Context& context,
               metrics::Registry& registry);

  /// Calls `Turn` until `stop`, then `Finish`. Throws what they throw, after it has spooled the
  /// steps that were not acknowledged. `between`: called after each turn, at least every 50 ms.
  void Run(std::stop_token stop, const std::function<void()>& between = {});

  /// Makes one step or, if something is missing for it, waits for at most `wait` for a message;
  /// sends chunks and handles the messages that came. Throws `base::Error` if a server refuses this
  /// process for good, or if another process of this name took over its session.
  void Turn(std::chrono::milliseconds wait);

  /// Sends the remaining chunks for at most `patience`, or a third of it if the server is away, and
  /// saves those that were not acknowledged to the spool. Destroying the service without this call
  /// has the effect of a `kill -9`. Throws what `Turn` throws, and if the spool cannot be written.
  void Finish(std::chrono::milliseconds patience);

  StepAccount account() const { return ledger_.account(); }

 private:
  /// Spools the steps that were not acknowledged, as well as it can, when an error ends the actor.
  void KeepUnsent();

  /// The phases follow each other like this:
  ///
  /// kDraining -> kStarting  The outbox is empty, or the server cannot continue the session.
  /// kStarting -> kRunning   The server welcomes the new session.
  /// kRunning  -> kStarting  The server cannot continue the session.
  ///
  /// In `kDraining` and `kRunning` the session is the ledger's, and the steps that the ledger does
  /// not count as acknowledged are in the outbox or in the chunk being filled.
  enum class Phase {
    kDraining,  ///< Sends the spool of the last session, under that session's number.
    kStarting,  ///< Has said hello for a new session. The outbox is empty.
    kRunning,   ///< Makes steps and sends them.
  };

  proto::Hello MakeHello(std::uint64_t session, int num_streams) const;
  /// Takes over the spool of the last session and returns its number of streams. Sets a damaged one
  /// aside and returns nothing.
  std::optional<int> LoadSpool();
  /// Renames the spool, so that no start reads it again.
  void SetSpoolAside(std::string_view why);
  void EndDraining();
  void StartSession(std::uint64_t session);
  void Replace(std::string_view why);
  void OnWelcome(const proto::Welcome& welcome);
  void OnAck(const proto::InsertAck& ack);
  void OnRefusal(const proto::Refusal& refusal);
  void Acknowledge(std::uint64_t next_sequence);
  /// Handles the servers' messages, waiting for one no longer than `timeout`.
  void Listen(std::chrono::milliseconds timeout);
  void SendChunks();
  void Step();
  /// Counts the steps that came into the chunk since the last call.
  void CountMade();
  /// Puts the rows made so far into the outbox.
  void CloseChunk();
  bool ChunkIsDue() const;
  /// Returns why no step can be made now, or null if one can.
  const char* Obstacle() const;
  bool MustWait() const;
  void SayObstacle(const char* obstacle);
  proto::Report MakeReport();
  std::filesystem::path spool() const { return identity_.state_directory / "spool"; }

  const ActorServiceConfig config_;
  const ActorConfig actor_config_;
  const SamplingConfig sampling_;
  const ActorIdentity identity_;
  env::BatchEnvironment& environments_;
  env::Agent& agent_;

  Ledger ledger_;
  Outbox outbox_;
  service::ReplayLink replay_;
  service::PolicyLink policy_;
  ActorMetrics metrics_;

  Phase phase_ = Phase::kStarting;
  LossReason reason_ = LossReason::kKilled;  ///< For steps that the last session left open.
  std::int64_t window_bytes_ = 0;
  int refused_in_a_row_ = 0;
  std::unique_ptr<Actor> actor_;  ///< Set while a session is running.
  replay::Chunk chunk_;           ///< The chunk being filled.
  int chunk_steps_ = 0;
  std::int64_t chunk_oldest_version_ = 0;
  std::chrono::steady_clock::time_point chunk_began_;
  const char* said_obstacle_ = nullptr;
  std::int64_t reported_steps_ = 0;
  std::chrono::steady_clock::time_point reported_at_;
};

}  // namespace slalom::actor
