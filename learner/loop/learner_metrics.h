#pragma once

#include <cstdint>

#include "learner/run/metrics_log.h"
#include "metrics/registry.h"

namespace slalom::learner {

/// The metrics of a process that learns. Confined to one thread.
class LearnerMetrics {
 public:
  explicit LearnerMetrics(metrics::Registry& registry);

  void AddUpdate(double seconds);
  /// Sets the learner's own columns of a row.
  void SetLearning(const run::MetricsRow& row);
  void AddCheckpoint(double seconds, std::int64_t bytes, std::int64_t updates);
  void AddFailedCheckpoint();
  void SetFinished(bool finished);

 private:
  metrics::Registry& registry_;
  metrics::Counter updates_;
  metrics::Histogram update_seconds_;
};

}  // namespace slalom::learner
