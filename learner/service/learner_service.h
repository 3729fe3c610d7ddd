#pragma once

#include <cstdint>
#include <stop_token>
#include <string>

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

/// What a learner process is to do, beside the algorithm.
struct LearnerJob {
  std::string name = "learner";
  LoopPlan loop;  ///< Except what `LearnerServiceConfig` says.
  std::uint64_t spec_hash = 0;
  transport::ClientOptions replay;
  transport::ServerOptions policies;
};

/// The learner as a process of its own: a `LearnerLoop` from a replay server's batches to whoever
/// asks for policies. Confined to the thread that made it.
class LearnerService {
 public:
  /// Goes on from the newest checkpoint in the directory that is whole; where there is none, begins
  /// anew. Publishes the policy it starts with. `clock` measures training time, which counts while
  /// batches come: not before the first one, nor in an outage of the replay server or of the
  /// actors. Tests give their own clock. Throws `base::Error` where config, checkpoints or endpoint
  /// are unusable.
  LearnerService(const LearnerServiceConfig& config, const MethodConfig& method,
                 const policy::PolicySpec& spec, LearnerJob job, transport::Context& context,
                 metrics::Registry& registry, run::TrainingClock clock = run::TrainingClock());

  /// Learns to the end of the run, then goes on serving its policy until `stop`, unless the config
  /// says otherwise, and returns how the run ended. Stopped before the end, it saves. Throws
  /// `base::Error` where the replay server refuses this process for good, or what must be kept
  /// cannot be written at the end.
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
