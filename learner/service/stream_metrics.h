#pragma once

#include "metrics/registry.h"

namespace slalom::learner {

/// The metrics of a stream of batches from a replay server. Confined to one thread.
class StreamMetrics {
 public:
  explicit StreamMetrics(metrics::Registry& registry);

  void AddBatch();
  /// Adds time spent waiting for batches. After 10 s without a batch, this becomes the registry's
  /// fault, which the health check shows, until a batch comes.
  void AddWait(double seconds);
  void SetStream(int in_flight, double policy_lag, int connections);

 private:
  metrics::Registry& registry_;
  metrics::Counter batches_;
  metrics::Counter waited_;
  double waiting_s_ = 0.0;  ///< Since the last batch.
};

}  // namespace slalom::learner
