#pragma once

#include <cstdint>
#include <string>

#include "metrics/registry.h"
#include "proto/messages.h"
#include "run/metrics_log.h"

namespace slalom::learner {

/// What all actors that report did lately, together. NaN: none has finished an episode.
struct ActorFigures {
  std::int64_t num_episodes = 0;
  double success_rate = 0.0;
  double collision_rate = 0.0;
  double timeout_rate = 0.0;
  double mean_return = 0.0;
  double mean_length = 0.0;
};

/// Means over the connected actors of a status.
ActorFigures Summarise(const proto::StatusReply& status);

/// The figures of a learner process. Confined to one thread.
class LearnerMetrics {
 public:
  explicit LearnerMetrics(metrics::Registry& registry);

  void AddBatch();
  void AddUpdate(double seconds);
  /// Time in which it waited for batches. Where no batch came for 10 s of it, that is the
  /// registry's fault until one does.
  void AddWait(double seconds);
  /// The learner's own figures of a row.
  void SetLearning(const run::MetricsRow& row);
  void SetStream(int in_flight, double policy_lag, int connections);
  void AddCheckpoint(double seconds, std::int64_t bytes, std::int64_t updates);
  void AddFailedCheckpoint();

 private:
  metrics::Registry& registry_;
  metrics::Counter batches_;
  metrics::Counter updates_;
  metrics::Counter waited_;
  metrics::Histogram update_seconds_;
  double waiting_s_ = 0.0;  ///< Since the last batch.
};

}  // namespace slalom::learner
