#include "policy/network_agent.h"

#include <ATen/ATen.h>
#include <gtest/gtest.h>

#include "policy/nn/feature_map.h"
#include "policy/nn/network.h"

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
  nn::InitialiseParameters(snapshot.spec.actor_shape(), random, weights);
  snapshot.weights = std::make_shared<const std::vector<float>>(std::move(weights));
  return snapshot;
}

/// LibTorch's own operations on one row of features.
env::Action Reference(const PolicySnapshot& snapshot, const std::vector<float>& features) {
  at::Tensor x = at::tensor(features).unsqueeze(0);
  const at::Tensor weights = at::tensor(*snapshot.weights);
  const std::vector<nn::ParameterSlot> slots = snapshot.spec.actor_shape().Slots();
  for (std::size_t i = 0; i < slots.size(); i += 2) {
    const auto part = [&](const nn::ParameterSlot& slot) {
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
  const nn::FeatureMap features(snapshot.spec.observation, snapshot.spec.network);
  base::Random random(2);
  env::ObservationBatch observations;
  observations.Resize(kBatch, snapshot.spec.observation.num_beams);
  std::vector<env::Action> actions(kBatch);
  std::vector<std::vector<std::vector<float>>> frames(kBatch);  // of the episode so far
  for (int step = 0; step < 12; ++step) {
    Randomise(random, observations);
    for (int i = 0; i < kBatch; ++i) observations.first[i] = step == 0 || (step + i) % 5 == 0;
    agent.Act(observations, env::NumbersOf(actions));
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

/// A policy with an encoder of its own; "beams" is a cnn over beams.
PolicySnapshot MakeEncoderPolicy(const std::string& encoder, std::uint64_t seed = 5) {
  PolicySnapshot snapshot = MakePolicy(3, 1);
  nn::NetworkConfig& network = snapshot.spec.network;
  SLALOM_CHECK(base::ParseEnum(encoder == "beams" ? "cnn" : encoder, network.encoder));
  if (encoder == "beams") network.cnn_axis = nn::CnnAxis::kBeams;
  network.encoder_layers = {16, 16};
  std::vector<float> weights(snapshot.spec.actor_shape().num_parameters());
  base::Random random(seed);
  nn::InitialiseParameters(snapshot.spec.actor_shape(), random, weights);
  snapshot.weights = std::make_shared<const std::vector<float>>(std::move(weights));
  return snapshot;
}

class NetworkAgentEncoderTest : public testing::TestWithParam<const char*> {};

// What the network says in float64 of the stacks of frames; sums of at most 64 products through
// about twelve layers: 12 * 64 * 2^-24 = 5e-5.
TEST_P(NetworkAgentEncoderTest, ActsOnTheStackOfFramesInEveryBatch) {
  const PolicySnapshot snapshot = MakeEncoderPolicy(GetParam());
  const nn::NetworkShape shape = snapshot.spec.actor_shape();
  const nn::FeatureMap features(snapshot.spec.observation, snapshot.spec.network);
  const nn::Network network(shape, at::tensor(*snapshot.weights).to(at::kDouble));
  base::Random random(4);
  NetworkAgent agent(MakeEncoderPolicy(GetParam(), 6));
  for (const int batch : {1, 64, 7}) {
    agent.SetSnapshot(batch == 7 ? MakeEncoderPolicy(GetParam(), 7) : snapshot);
    if (batch == 7) agent.SetSnapshot(snapshot);
    env::ObservationBatch observations;
    observations.Resize(batch, snapshot.spec.observation.num_beams);
    std::vector<env::Action> actions(batch);
    at::Tensor stack = at::zeros({batch, 3, features.frame_size()});
    for (int step = 0; step < 4; ++step) {
      Randomise(random, observations);
      for (int i = 0; i < batch; ++i) observations.first[i] = step == 0;
      agent.Act(observations, env::NumbersOf(actions));
      at::Tensor frame = at::zeros({batch, 1, features.frame_size()});
      for (int i = 0; i < batch; ++i) {
        const env::FrameView view = observations.frame(i);
        features.Write(view.ranges_cm.data(), view.state.data(), false, frame[i].data_ptr<float>());
      }
      stack = step == 0 ? frame.repeat({1, 3, 1}) : at::cat({stack.narrow(1, 1, 2), frame}, 1);
      nn::NetworkPass pass(shape, stack.view({batch, -1}).to(at::kDouble), nn::PassUse::kInference);
      network.Forward(pass);
      const at::Tensor expected = at::tanh(pass.output());
      for (int i = 0; i < batch; ++i) {
        EXPECT_NEAR(actions[i].linear, expected[i][0].item<double>(), 5e-5);
        EXPECT_NEAR(actions[i].angular, expected[i][1].item<double>(), 5e-5);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Encoders, NetworkAgentEncoderTest,
                         testing::Values("cnn", "beams", "gru", "transformer"),
                         [](const auto& test) { return std::string(test.param); });

TEST(NetworkAgent, DropsWhenActingOnlyWherePoliciesDoEverywhere) {
  base::Random random(3);
  env::ObservationBatch observations;
  observations.Resize(2, 24);
  Randomise(random, observations);
  for (int i = 0; i < 2; ++i) observations.first[i] = true;
  const auto act = [&](bool dropout, bool everywhere) {
    PolicySnapshot snapshot = MakeEncoderPolicy("transformer");
    snapshot.spec.network.dropout = dropout ? 0.3 : 0.0;
    snapshot.spec.network.dropout_everywhere = everywhere;
    std::vector<env::Action> actions(2);
    NetworkAgent(snapshot).Act(observations, env::NumbersOf(actions));
    return actions;
  };
  const std::vector<env::Action> without = act(false, false);
  EXPECT_EQ(act(true, false), without);
  EXPECT_NE(act(true, true), without);
  EXPECT_EQ(act(true, true), act(true, true)) << "the same frames give the same action";
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
  agent.Act(observations, env::NumbersOf(actions));
  expected.Act(observations, env::NumbersOf(expected_actions));
  EXPECT_EQ(actions, expected_actions);
}

}  // namespace
}  // namespace slalom::policy
