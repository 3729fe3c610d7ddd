#pragma once

#include <cstdint>

#include "metrics/registry.h"
#include "run/metrics_log.h"

namespace slalom::learner {

/// The metrics of a learner process. Confined to one thread.
class LearnerMetrics {
 public:
  explicit LearnerMetrics(metrics::Registry& registry);

  void AddBatch();
  void AddUpdate(double seconds);
  /// Adds time spent waiting for batches. After 10 s without a batch, this becomes the registry's
  /// fault, which the health check shows, until a batch comes.
  void AddWait(double seconds);
  /// Sets the learner's own columns of a row.
  void SetLearning(const run::MetricsRow& row);
  void SetStream(int in_flight, double policy_lag, int connections);
  void AddCheckpoint(double seconds, std::int64_t bytes, std::int64_t updates);
  void AddFailedCheckpoint();
  void SetFinished(bool finished);

 private:
  metrics::Registry& registry_;
  metrics::Counter batches_;
  metrics::Counter updates_;
  metrics::Counter waited_;
  metrics::Histogram update_seconds_;
  double waiting_s_ = 0.0;  ///< Since the last batch.
};

}  // namespace slalom::learner
