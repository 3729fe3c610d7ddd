#include "learner/loop/learner_metrics.h"

#include "base/clock.h"
#include "metrics/catalogue.h"
#include "metrics/learning_figures.h"

namespace slalom::learner {

LearnerMetrics::LearnerMetrics(metrics::Registry& registry)
    : registry_(registry),
      updates_(registry.counter(metrics::kUpdates)),
      update_seconds_(registry.histogram(metrics::kUpdateSeconds)) {
  registry_.counter(metrics::kCheckpoints);
  registry_.counter(metrics::kCheckpointFailures);
  registry_.gauge(metrics::kCheckpointTimestamp).Set(base::UnixSeconds());
}

void LearnerMetrics::AddUpdate(double seconds) { update_seconds_.Observe(seconds); }

void LearnerMetrics::SetLearning(const run::MetricsRow& row) {
  updates_.RaiseTo(static_cast<double>(row.updates));
  if (row.updates_per_s > 0.0) metrics::ShowLearning(row.learning, registry_);
}

void LearnerMetrics::AddCheckpoint(double seconds, std::int64_t bytes, std::int64_t updates) {
  registry_.counter(metrics::kCheckpoints).Increment();
  registry_.gauge(metrics::kCheckpointTimestamp).Set(base::UnixSeconds());
  registry_.gauge(metrics::kCheckpointSeconds).Set(seconds);
  registry_.gauge(metrics::kCheckpointBytes).Set(static_cast<double>(bytes));
  registry_.gauge(metrics::kCheckpointUpdates).Set(static_cast<double>(updates));
}

void LearnerMetrics::AddFailedCheckpoint() {
  registry_.counter(metrics::kCheckpointFailures).Increment();
}

void LearnerMetrics::SetFinished(bool finished) {
  registry_.gauge(metrics::kRunFinished).Set(finished ? 1.0 : 0.0);
}

}  // namespace slalom::learner
