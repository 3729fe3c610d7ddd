#pragma once

#include <cstdint>

#include "metrics/registry.h"
#include "run/metrics_log.h"

namespace slalom::learner {

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
