#include "actor/service/actor_metrics.h"

#include <fmt/format.h>

#include <limits>
#include <utility>

#include "metrics/catalogue.h"

namespace slalom::actor {

ActorMetrics::ActorMetrics(metrics::Registry& registry, std::string course_set,
                           std::int64_t outbox_limit, int num_environments)
    : registry_(registry), course_set_(std::move(course_set)) {
  registry_.gauge(metrics::kQueueLimitBytes, {metrics::queue::kUnacknowledged})
      .Set(static_cast<double>(outbox_limit));
  registry_.gauge(metrics::kEnvironments).Set(num_environments);
  registry_.counter(metrics::kBlockedSeconds, {metrics::queue::kUnacknowledged});
  registry_.counter(metrics::kChunksSent);
  registry_.counter(metrics::kChunksResent);
  registry_.counter(metrics::kStepsSent);
  registry_.counter(metrics::kStepsResent);
  registry_.counter(metrics::kChunksAcknowledged);
  for (const proto::RefusalCode code : proto::kRefusalCodes) {
    registry_.counter(metrics::kChunksRejected, {proto::ToString(code)});
  }
  registry_.histogram(metrics::kPublishToActing);
}

void ActorMetrics::Update(const StepAccount& account, const Outbox& outbox,
                          const ActorStats& episodes, service::ReplayLink& replay,
                          service::PolicyLink& policy) {
  registry_.counter(metrics::kEnvironmentSteps).RaiseTo(static_cast<double>(account.made));
  // Steps that a server lost had been acknowledged before, and a counter must never fall.
  registry_.counter(metrics::kStepsAcknowledged)
      .RaiseTo(static_cast<double>(account.accepted +
                                   account.lost[static_cast<int>(LossReason::kServer)]));
  registry_.gauge(metrics::kStepsPending).Set(static_cast<double>(account.pending));
  for (int i = 0; i < kNumLossReasons; ++i) {
    registry_.counter(metrics::kStepsLost, {ToString(static_cast<LossReason>(i))})
        .RaiseTo(static_cast<double>(account.lost[i]));
  }
  registry_.gauge(metrics::kQueueDepth, {metrics::queue::kUnacknowledged}).Set(outbox.num_chunks());
  registry_.gauge(metrics::kQueueBytes, {metrics::queue::kUnacknowledged})
      .Set(static_cast<double>(outbox.bytes()));
  for (const auto outcome : {env::Outcome::kSuccess, env::Outcome::kCollision,
                             env::Outcome::kTimeout, env::Outcome::kTerminated}) {
    const bool never_on_courses = outcome == env::Outcome::kTerminated;
    if (never_on_courses && episodes.num_outcomes[static_cast<int>(outcome)] == 0) continue;
    registry_.counter(metrics::kEpisodes, {env::ToString(outcome), course_set_})
        .RaiseTo(static_cast<double>(episodes.num_outcomes[static_cast<int>(outcome)]));
  }
  const auto known = [&episodes](double value) {
    return episodes.num_recent > 0 ? value : std::numeric_limits<double>::quiet_NaN();
  };
  registry_.gauge(metrics::kSuccessRate).Set(known(episodes.success_rate));
  registry_.gauge(metrics::kCollisionRate).Set(known(episodes.collision_rate));
  registry_.gauge(metrics::kEpisodeReturn).Set(known(episodes.mean_return));
  registry_.gauge(metrics::kEpisodeSteps).Set(known(episodes.mean_length));
  registry_.gauge(metrics::kCoursesDriven).Set(static_cast<double>(episodes.sampling.num_courses));
  registry_.gauge(metrics::kFreshSuccess).Set(episodes.sampling.mean_success);
  registry_.gauge(metrics::kLearnableShare).Set(episodes.sampling.learnable_share);
  registry_.counter(metrics::kConnections, {"replay"}).RaiseTo(replay.connections());
  registry_.counter(metrics::kConnections, {"learner"}).RaiseTo(policy.connections());
  registry_.counter(metrics::kPoliciesReceived).RaiseTo(static_cast<double>(policy.received()));
  registry_.counter(metrics::kPoliciesRejected).RaiseTo(static_cast<double>(policy.rejected()));
  registry_.gauge(metrics::kPolicyVersion).Set(static_cast<double>(policy.version()));
  registry_.gauge(metrics::kPolicyTimestamp).Set(policy.published_s());
}

void ActorMetrics::AddBlocked(std::string_view queue, double seconds) {
  registry_.counter(metrics::kBlockedSeconds, {queue}).Increment(seconds);
}

void ActorMetrics::AddSent(int steps, bool again) {
  registry_.counter(again ? metrics::kChunksResent : metrics::kChunksSent).Increment();
  registry_.counter(again ? metrics::kStepsResent : metrics::kStepsSent).Increment(steps);
}

void ActorMetrics::AddAcknowledged(int chunks) {
  registry_.counter(metrics::kChunksAcknowledged).Increment(chunks);
}

void ActorMetrics::AddRefused(std::string_view reason) {
  registry_.counter(metrics::kChunksRejected, {reason}).Increment();
}

void ActorMetrics::AddPolicyInstalled(double latency_s) {
  registry_.histogram(metrics::kPublishToActing).Observe(latency_s);
}

void ActorMetrics::SetObstacle(const char* obstacle) {
  registry_.SetFault(obstacle == nullptr ? "" : fmt::format("waiting for {}", obstacle));
}

}  // namespace slalom::actor
