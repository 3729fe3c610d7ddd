#pragma once

#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "learner/learner.h"
#include "learner/loop/learner_loop.h"
#include "learner/service/learner_service_config.h"
#include "learner/service/policy_server.h"
#include "learner/service/remote_source.h"
#include "metrics/registry.h"
#include "policy/policy.h"
#include "proto/transport/client.h"
#include "proto/transport/context.h"
#include "proto/transport/server.h"

namespace slalom::learner {

/// The task of a learner process, besides the algorithm.
struct LearnerJob {
  std::string name = "learner";
  LoopPlan loop;  ///< `LearnerServiceConfig` overrides some fields.
  std::uint64_t spec_hash = 0;
  proto::RunIdentity run;
  std::vector<transport::ClientOptions> replay;  ///< As for `RemoteSource`.
  std::int64_t table_rows = 0;  ///< Of each replay server: its mirror has as many places at most.
  transport::ServerOptions policies;
  std::optional<policy::PolicySnapshot> first{};  ///< The actor to start from (`learner.from`).
};

/// The learner as a process of its own: a `LearnerLoop` between the batches of a replay server and
/// the readers of its policies. Confined to the thread that made it.
class LearnerService {
 public:
  /// Continues from the newest intact checkpoint in the directory, or starts a new run if there is
  /// none. Publishes the policy that it starts with. `clock` measures training time, which counts
  /// while batches come: not before the first one, nor in an outage of the replay server or of the
  /// actors. Tests give their own clock. Throws `base::Error` if config, checkpoints or endpoint
  /// are unusable.
  LearnerService(const LearnerServiceConfig& config, const MethodConfig& method,
                 const policy::PolicySpec& spec, LearnerJob job, transport::Context& context,
                 metrics::Registry& registry, run::TrainingClock clock = run::TrainingClock());

  /// Learns until the run ends, then serves its policy until `stop`, unless the config says
  /// otherwise. Returns how the run ended. If stopped before the end, it saves. Throws
  /// `base::Error` if the replay server refuses this process for good, or if the files that must be
  /// kept cannot be written at the end.
  TrainingEnd Run(std::stop_token stop);

  const std::string& endpoint() const { return policies_.endpoint(); }

 private:
  void Serve(std::stop_token stop);

  const LearnerServiceConfig config_;
  Learner learner_;
  PolicyServer policies_;
  RemoteSource source_;
  LearnerLoop loop_;
};

}  // namespace slalom::learner
