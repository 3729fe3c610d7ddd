#include "policy/network_agent.h"

#include <ATen/ATen.h>
#include <gtest/gtest.h>

#include "policy/feature_map.h"

namespace slalom::policy {
namespace {

PolicySnapshot MakePolicy(int history, std::uint64_t seed) {
  PolicySnapshot snapshot;
  snapshot.spec.observation.num_beams = 24;
  snapshot.spec.network.encoder_layers = {16};
  snapshot.spec.network.head_layers = {8};
  snapshot.spec.network.history = history;
  snapshot.spec.network.sectors = 12;
  std::vector<float> weights(snapshot.spec.actor_shape().num_parameters());
  base::Random random(seed);
  InitialiseParameters(snapshot.spec.actor_shape(), random, weights);
  snapshot.weights = std::make_shared<const std::vector<float>>(std::move(weights));
  return snapshot;
}

/// LibTorch's own operations on one row of features.
env::Action Reference(const PolicySnapshot& snapshot, const std::vector<float>& features) {
  at::Tensor x = at::tensor(features).unsqueeze(0);
  const at::Tensor weights = at::tensor(*snapshot.weights);
  const std::vector<ParameterSlot> slots = snapshot.spec.actor_shape().Slots();
  for (std::size_t i = 0; i < slots.size(); i += 2) {
    const auto part = [&](const ParameterSlot& slot) {
      return weights.narrow(0, slot.offset, slot.size()).view(slot.shape);
    };
    x = at::linear(x, part(slots[i]), part(slots[i + 1]));
    if (i + 2 < slots.size()) x = at::relu(x);
  }
  x = at::tanh(x);
  return {x[0][0].item<float>(), x[0][1].item<float>()};
}

void Randomise(base::Random& random, env::ObservationBatch& observations) {
  for (auto& range : observations.ranges_cm) {
    range = static_cast<std::uint16_t>(random.UniformInt(501));
  }
  for (float& value : observations.state) value = static_cast<float>(random.Uniform(-1.0, 1.0));
}

/// Sums of at most 34 products of numbers below 1 through three layers: 3 * 34 roundings of 2^-24.
constexpr float kTolerance = 3 * 34 * 0x1p-24f;

TEST(NetworkAgent, IsLibTorchsForwardOnTheLastFrames) {
  constexpr int kBatch = 3;
  constexpr int kHistory = 3;
  const PolicySnapshot snapshot = MakePolicy(kHistory, 1);
  NetworkAgent agent(snapshot);
  const FeatureMap features(snapshot.spec.observation, snapshot.spec.network);
  base::Random random(2);
  env::ObservationBatch observations;
  observations.Resize(kBatch, snapshot.spec.observation.num_beams);
  std::vector<env::Action> actions(kBatch);
  std::vector<std::vector<std::vector<float>>> frames(kBatch);  // of the episode so far
  for (int step = 0; step < 12; ++step) {
    Randomise(random, observations);
    for (int i = 0; i < kBatch; ++i) observations.first[i] = step == 0 || (step + i) % 5 == 0;
    agent.Act(observations, actions);
    for (int i = 0; i < kBatch; ++i) {
      if (observations.first[i]) frames[i].clear();
      const env::FrameView view = observations.frame(i);
      frames[i].emplace_back(features.frame_size());
      features.Write(view.ranges_cm.data(), view.state.data(), false, frames[i].back().data());
      std::vector<float> input;
      for (int age = kHistory - 1; age >= 0; --age) {
        const int index = std::max(0, static_cast<int>(frames[i].size()) - 1 - age);
        input.insert(input.end(), frames[i][index].begin(), frames[i][index].end());
      }
      const env::Action expected = Reference(snapshot, input);
      EXPECT_NEAR(actions[i].linear, expected.linear, kTolerance);
      EXPECT_NEAR(actions[i].angular, expected.angular, kTolerance);
    }
  }
}

TEST(NetworkAgent, TakesNewWeights) {
  const PolicySnapshot other = MakePolicy(1, 9);
  NetworkAgent agent(MakePolicy(1, 1));
  NetworkAgent expected(other);
  agent.SetSnapshot(other);
  base::Random random(3);
  env::ObservationBatch observations;
  observations.Resize(2, 24);
  Randomise(random, observations);
  std::vector<env::Action> actions(2), expected_actions(2);
  agent.Act(observations, actions);
  expected.Act(observations, expected_actions);
  EXPECT_EQ(actions, expected_actions);
}

}  // namespace
}  // namespace slalom::policy
