#include "learner/service/stream_metrics.h"

#include <fmt/format.h>

#include "metrics/catalogue.h"

namespace slalom::learner {
namespace {

// [s], longer than a restart of the replay server takes.
constexpr double kPatience = 10.0;

}  // namespace

StreamMetrics::StreamMetrics(metrics::Registry& registry)
    : registry_(registry),
      batches_(registry.counter(metrics::kBatches)),
      waited_(registry.counter(metrics::kBlockedSeconds, {metrics::queue::kBatches})) {}

void StreamMetrics::AddBatch() {
  batches_.Increment();
  if (waiting_s_ >= kPatience) registry_.SetFault("");
  waiting_s_ = 0.0;
}

void StreamMetrics::AddWait(double seconds) {
  waited_.Increment(seconds);
  waiting_s_ += seconds;
  if (waiting_s_ < kPatience) return;
  registry_.SetFault(fmt::format("no batch came from the replay server for {:.0f} s", waiting_s_));
}

void StreamMetrics::SetStream(int in_flight, double policy_lag, int connections) {
  registry_.gauge(metrics::kQueueDepth, {metrics::queue::kBatches}).Set(in_flight);
  registry_.gauge(metrics::kPolicyLag).Set(policy_lag);
  registry_.counter(metrics::kConnections, {"replay"}).RaiseTo(connections);
}

}  // namespace slalom::learner
