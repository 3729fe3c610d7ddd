#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"
#include "policy/network_agent.h"
#include "tests/support/allocation_count.h"
#include "tests/support/every_value.h"

/// What a robot's program does at each step. Needs no LibTorch.

namespace slalom::policy {
namespace {

PolicySnapshot MakePolicy(nn::EncoderFamily encoder, DistributionKind distribution) {
  PolicySnapshot snapshot;
  snapshot.spec.observation.num_beams = 48;
  snapshot.spec.network.encoder = encoder;
  snapshot.spec.network.encoder_layers = {16, 16};
  snapshot.spec.network.head_layers = {8};
  snapshot.spec.network.history = 3;
  snapshot.spec.distribution = {.kind = distribution, .log_std_min = -5.0, .log_std_max = 2.0};
  std::vector<float> weights(snapshot.spec.actor_shape().num_parameters());
  base::Random random(1);
  nn::InitialiseParameters(snapshot.spec.actor_shape(), random, weights);
  snapshot.weights = std::make_shared<const std::vector<float>>(std::move(weights));
  return snapshot;
}

TEST(NetworkAgent, AllocatesNothingForAnAction) {
  for (const nn::EncoderFamily encoder : test::EveryValue<nn::EncoderFamily>()) {
    for (const DistributionKind distribution : test::EveryValue<DistributionKind>()) {
      const PolicySnapshot snapshot = MakePolicy(encoder, distribution);
      NetworkAgent agent(snapshot);
      base::Random random(2);
      env::ObservationBatch observations;
      observations.Resize(5, snapshot.spec.observation.num_beams);
      for (auto& range : observations.ranges_cm) {
        range = static_cast<std::uint16_t>(random.UniformInt(501));
      }
      std::vector<env::Action> actions(5);
      const std::vector<env::Action> noise(5, {0.5f, -0.5f});
      agent.Act(observations, env::NumbersOf(actions));
      const long before = test::NumAllocations();
      for (int step = 0; step < 5; ++step) {
        agent.Act(observations, env::NumbersOf(actions));
        agent.Explore(env::NumbersOf(noise), env::NumbersOf(actions));
      }
      EXPECT_EQ(test::NumAllocations() - before, 0)
          << base::EnumName(encoder) << ", " << base::EnumName(distribution);
      for (const env::Action& action : actions) {
        EXPECT_LT(std::abs(action.linear), 1.0f);
        EXPECT_LT(std::abs(action.angular), 1.0f);
      }
    }
  }
}

}  // namespace
}  // namespace slalom::policy
