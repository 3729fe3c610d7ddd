#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "learner/service/actor_figures.h"
#include "learner/service/batch_stream.h"
#include "learner/service/learner_metrics.h"
#include "learner/service/learner_run.h"
#include "learner/service/learner_service_config.h"
#include "learner/service/policy_server.h"
#include "metrics/registry.h"
#include "policy/policy.h"
#include "transport/client.h"
#include "transport/context.h"
#include "transport/server.h"

namespace slalom::learner {

/// What a learner process is to do, beside the algorithm.
struct LearnerJob {
  std::string name = "learner";
  RunPlan plan;
  std::uint64_t spec_hash = 0;
  double checkpoint_seconds = 60.0;
  int publish_interval = 10;  ///< Updates.
  transport::ClientOptions replay;
  transport::ServerOptions policies;
};

/// How it ended.
enum class LearnerEnd {
  kStopped,   ///< On request, or finished and `exit_when_finished`; saved.
  kDiverged,  ///< At NaN or values beyond bounds; the last good checkpoint is kept.
};

/// The learner as a process of its own: learns from the replay server's batches, publishes
/// policies, and keeps checkpoints from which it goes on exactly where they stood. Confined to the
/// thread that made it.
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

  /// Learns to the end of the run, goes on serving its policy, and saves at `stop`. Throws
  /// `base::Error` where the replay server refuses this process for good, or what must be kept
  /// cannot be written at the end.
  LearnerEnd Run(std::stop_token stop);

  std::int64_t updates() const { return run_.updates(); }
  double training_s() const { return run_.training_s(); }
  const std::string& endpoint() const { return policies_.endpoint(); }

 private:
  void LearnFrom(const RemoteBatches& batches);
  void PublishIfDue();
  void Publish();
  /// The rows of metrics, logs and reports. False: the learner diverged.
  [[nodiscard]] bool Log();
  void TryCheckpoint();
  void Checkpoint();
  void Restore();
  void Say(const std::string& what);

  const LearnerServiceConfig config_;
  const bool prioritized_;
  const LearnerJob job_;
  LearnerRun run_;
  PolicyServer policies_;
  std::unique_ptr<BatchStream> batches_;  // Made with the cursor of the checkpoint.
  LearnerMetrics metrics_;
  FinishedEpisodes finished_episodes_;

  std::uint64_t cursor_ = 0;  ///< Restored.
  std::int64_t table_steps_ = 0;
  double acting_version_ = 0.0;
  bool finished_ = false;
  std::int64_t published_updates_ = 0;
  std::chrono::steady_clock::time_point published_at_;
  double waited_s_ = 0.0;                  ///< For batches, since the last row.
  std::optional<double> waiting_since_s_;  ///< For a batch, by the run's wall clock.
  double appended_at_s_ = 0.0;             ///< Training time of the last row of metrics.csv.
  double model_steps_error_ = run::MetricsRow::kNone;  ///< The newest.
  std::string said_;
};

}  // namespace slalom::learner
