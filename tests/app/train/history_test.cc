#include <ATen/ATen.h>
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "actor/actor.h"
#include "learner/minibatch.h"
#include "policy/network_agent.h"
#include "policy/nn/network.h"
#include "replay/table.h"
#include "tests/support/fake_environment.h"

/// The stacks of frames that a policy acts on and those that it learns from, which are put together
/// apart.

namespace slalom {
namespace {

constexpr int kBatch = 6;
constexpr int kBeams = 24;

class HistoryTest : public ::testing::TestWithParam<int> {};

TEST_P(HistoryTest, ThePolicyWouldActOnAStackFromTheReplayAsItDid) {
  policy::PolicySnapshot snapshot;
  snapshot.spec.observation.num_beams = kBeams;
  snapshot.spec.network.encoder_layers = {};
  snapshot.spec.network.head_layers = {16};
  snapshot.spec.network.history = GetParam();
  snapshot.spec.network.sectors = 12;
  const nn::NetworkShape shape = snapshot.spec.actor_shape();
  std::vector<float> weights(shape.num_parameters());
  base::Random random(1);
  nn::InitialiseParameters(shape, random, weights);
  snapshot.weights = std::make_shared<const std::vector<float>>(std::move(weights));

  testing::FakeEnvironment environments(kBatch, {0.2, 0.8}, /*max_length=*/12, kBeams);
  policy::NetworkAgent agent(snapshot);
  actor::ActorConfig config;
  config.noise_min = config.noise_max = 0.0;
  actor::Actor actor(config, environments, agent, 3);
  replay::Table table({.capacity = 500}, kBeams);
  replay::Chunk chunk(kBeams);
  for (int step = 0; step < 120; ++step) {
    chunk.Clear();
    actor.Step(&chunk);
    table.Insert(chunk);
  }

  const int batch = 256;
  replay::SampledRows rows;
  ASSERT_TRUE(
      table.SampleRows({.batch = batch, .history = GetParam(), .n_step = 3}, random, &rows));
  const nn::FeatureMap features(snapshot.spec.observation, snapshot.spec.network);
  learner::MinibatchReader reader(features, GetParam(), 1.0, /*mirror=*/false, 1.0);
  learner::Minibatch minibatch(batch, GetParam(), features.frame_size(), at::kCPU);
  reader.Read(rows, random, minibatch);
  nn::NetworkPass pass(shape, minibatch.features, nn::PassUse::kInference);
  const nn::Network network(shape, nn::ViewWeights(*snapshot.weights));
  network.Forward(pass);
  const at::Tensor acted = at::tanh(pass.output());
  EXPECT_LT((acted - minibatch.actions).abs().max().item<float>(), 1e-5f);
  EXPECT_GT(minibatch.actions.std().item<float>(), 0.01f);
}

INSTANTIATE_TEST_SUITE_P(Frames, HistoryTest, ::testing::Values(1, 2, 3, 4, 8));

}  // namespace
}  // namespace slalom
