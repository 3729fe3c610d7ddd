#include "actor/service/actor_metrics.h"

#include <gtest/gtest.h>

#include <string>

#include "metrics/catalogue.h"
#include "proto/transport/context.h"

namespace slalom::actor {
namespace {

// Each figure on its own, as no two of them are alike here.
TEST(ActorMetricsTest, ShowsTheAccountAndWhatIsOnItsWay) {
  metrics::Registry registry("actor", "a");
  ActorMetrics shown(registry, "fake", 5000, 4);
  transport::Context context;
  service::ReplayLink replay(context, {.endpoint = "ipc://@slalom-nobody-replay"}, {});
  service::PolicyLink policy(context, {.endpoint = "ipc://@slalom-nobody-learner"}, "a", {});
  StepAccount account;
  account.made = 100;
  account.accepted = 67;
  account.pending = 20;
  account.lost = {1, 4, 8};  // killed, replaced, server
  Outbox outbox(5000);
  outbox.Begin(1);
  for (int i = 0; i < 2; ++i) {
    proto::Insert header;
    header.num_rows = header.num_steps = 10;
    header.num_beams = 1;
    outbox.Add(header, transport::Frame::Copy(std::string(150, 'x')));
  }
  ActorStats stats;
  for (int i = 0; i < env::kNumOutcomes; ++i) stats.num_outcomes[i] = 2 + i;
  stats.num_recent = 8;
  stats.success_rate = 0.625;
  stats.collision_rate = 0.375;
  StepAccount before = account;
  before.made = 40;
  before.accepted = 30;
  before.lost = {0, 1, 2};
  shown.Update(before, Outbox(5000), {}, replay, policy);
  for (int i = 0; i < 2; ++i) shown.Update(account, outbox, stats, replay, policy);
  shown.AddSent(10, false);
  shown.AddSent(7, true);
  shown.AddSent(5, true);
  shown.AddAcknowledged(3);
  shown.AddRefused("out_of_order");
  shown.AddBlocked(metrics::queue::kUnacknowledged, 1.5);

  const auto count = [&](const metrics::Spec& spec,
                         std::initializer_list<std::string_view> labels = {}) {
    return registry.counter(spec, labels).value();
  };
  EXPECT_EQ(count(metrics::kEnvironmentSteps), 100);
  EXPECT_EQ(count(metrics::kStepsAcknowledged), 75) << "with those that the server lost later";
  EXPECT_EQ(registry.gauge(metrics::kStepsPending).value(), 20);
  EXPECT_EQ(count(metrics::kStepsLost, {"killed"}), 1);
  EXPECT_EQ(count(metrics::kStepsLost, {"replaced"}), 4);
  EXPECT_EQ(count(metrics::kStepsLost, {"server"}), 8);
  EXPECT_EQ(registry.gauge(metrics::kQueueDepth, {metrics::queue::kUnacknowledged}).value(), 2);
  EXPECT_EQ(registry.gauge(metrics::kQueueBytes, {metrics::queue::kUnacknowledged}).value(), 300);
  EXPECT_EQ(registry.gauge(metrics::kQueueLimitBytes, {metrics::queue::kUnacknowledged}).value(),
            5000);
  for (int i = 1; i < env::kNumOutcomes; ++i) {
    EXPECT_EQ(count(metrics::kEpisodes, {env::ToString(static_cast<env::Outcome>(i)), "fake"}),
              2 + i);
  }
  EXPECT_EQ(registry.gauge(metrics::kSuccessRate).value(), 0.625);
  EXPECT_EQ(registry.gauge(metrics::kCollisionRate).value(), 0.375);
  EXPECT_EQ(count(metrics::kChunksSent), 1);
  EXPECT_EQ(count(metrics::kStepsSent), 10);
  EXPECT_EQ(count(metrics::kChunksResent), 2);
  EXPECT_EQ(count(metrics::kStepsResent), 12);
  EXPECT_EQ(count(metrics::kChunksAcknowledged), 3);
  EXPECT_EQ(count(metrics::kChunksRejected, {"out_of_order"}), 1);
  EXPECT_EQ(count(metrics::kBlockedSeconds, {metrics::queue::kUnacknowledged}), 1.5);
  EXPECT_EQ(registry.fault(), "");
  shown.SetObstacle("the learner");
  EXPECT_EQ(registry.fault(), "waiting for the learner");
}

}  // namespace
}  // namespace slalom::actor
