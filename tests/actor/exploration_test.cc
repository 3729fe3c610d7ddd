#include <gtest/gtest.h>

#include <cmath>
#include <span>
#include <vector>

#include "actor/actor.h"
#include "base/error.h"
#include "tests/support/fake_environment.h"

/// What an actor adds to its agent's choices.

namespace slalom::actor {
namespace {

using testing::ConstantAgent;
using testing::FakeEnvironment;

constexpr int kBatch = 6;
const std::vector<double> kSuccess{0.1, 0.5, 0.9};

struct Moments {
  double mean = 0.0;
  double deviation = 0.0;
};

Moments MomentsOf(const std::vector<double>& values) {
  Moments moments;
  for (const double value : values) moments.mean += value / static_cast<double>(values.size());
  for (const double value : values) {
    moments.deviation +=
        (value - moments.mean) * (value - moments.mean) / static_cast<double>(values.size());
  }
  moments.deviation = std::sqrt(moments.deviation);
  return moments;
}

/// Actions of each environment, linear and angular parts together, around what the agent commands.
std::vector<std::vector<double>> Noise(const ActorConfig& config, env::Action command,
                                       int num_steps) {
  FakeEnvironment environments(3, kSuccess);
  ConstantAgent agent(command);
  Actor actor(config, environments, agent, 17);
  std::vector<std::vector<double>> noise(3);
  replay::Chunk chunk(8);
  for (int step = 0; step < num_steps; ++step) {
    chunk.Clear();
    actor.Step(&chunk);
    for (int r = 0; r < chunk.num_rows(); ++r) {
      if (chunk.flags[r] & replay::kRowFinal) continue;
      noise[chunk.stream[r]].push_back(chunk.row(r).action[0] - command.linear);
      noise[chunk.stream[r]].push_back(chunk.row(r).action[1] - command.angular);
    }
  }
  return noise;
}

TEST(Actor, AddsNoiseOfTheConfiguredSpread) {
  ActorConfig config;
  config.noise_min = 0.05;
  config.noise_max = 0.2;
  const auto noise = Noise(config, {}, 20000);
  const double expected[] = {0.05, 0.1, 0.2};  // Geometric. 0.2 is clipped at 5 sigma: no matter.
  for (int i = 0; i < 3; ++i) {
    const Moments moments = MomentsOf(noise[i]);
    // 40000 draws: standard errors sigma / 200 and sigma / 283; five of each.
    EXPECT_NEAR(moments.mean, 0.0, 5.0 * expected[i] / 200.0);
    EXPECT_NEAR(moments.deviation, expected[i], 5.0 * expected[i] / 283.0);
  }
}

TEST(Actor, ClipsActions) {
  ActorConfig config;
  config.noise_min = config.noise_max = 0.5;
  int num_at_bound = 0;
  for (const auto& environment : Noise(config, {0.9f, -0.9f}, 200)) {
    for (std::size_t k = 0; k < environment.size(); ++k) {
      const double action = environment[k] + (k % 2 == 0 ? 0.9 : -0.9);
      EXPECT_LE(std::abs(action), 1.0 + 1e-6);
      num_at_bound += std::abs(action) > 1.0 - 1e-6;
    }
  }
  EXPECT_GT(num_at_bound, 300);  // About 0.42 of 1200.
}

TEST(Actor, WarmsUpWithUniformActions) {
  ActorConfig config;
  config.noise_min = config.noise_max = 0.0;
  config.warmup_steps = 3 * 5000;
  const auto noise = Noise(config, {0.25f, 0.25f}, 5001);
  for (const auto& environment : noise) {
    std::vector<double> warmup(environment.begin(), environment.end() - 2);
    for (double& value : warmup) value += 0.25;
    const Moments moments = MomentsOf(warmup);
    // Uniform on [-1, 1]: deviation 1 / sqrt(3); 10000 draws: standard errors 0.0058 and 0.0026.
    EXPECT_NEAR(moments.mean, 0.0, 5 * 0.0058);
    EXPECT_NEAR(moments.deviation, 1.0 / std::sqrt(3.0), 5 * 0.0026);
    EXPECT_EQ(environment.back(), 0.0);  // Then the policy drives.
  }
}

/// Draws half of each standard normal number.
class GaussianAgent : public ConstantAgent {
 public:
  GaussianAgent() : ConstantAgent({0.25f, 0.25f}) {}
  bool Explore(std::span<const float> noise, std::span<float> actions) override {
    for (std::size_t i = 0; i < actions.size(); ++i) actions[i] = 0.5f * noise[i];
    return true;
  }
};

TEST(Actor, ExploresByTheAgentsOwnDistribution) {
  constexpr std::uint64_t kSeed = 9;
  FakeEnvironment environments(kBatch, kSuccess);
  GaussianAgent agent;
  Actor actor({}, environments, agent, kSeed);
  replay::Chunk chunk(8);
  for (int step = 0; step < 20; ++step) actor.Step(&chunk);
  std::vector<base::Random> noise;
  for (std::uint64_t i = 0; i < kBatch; ++i) {
    noise.emplace_back(base::DeriveSeed(kSeed, "exploration", {i}));
  }
  for (int r = 0; r < chunk.num_rows(); ++r) {
    const replay::RowView row = chunk.row(r);
    if (row.flags & replay::kRowFinal) continue;
    base::Random& random = noise[row.stream];
    EXPECT_EQ(row.action[0], 0.5f * static_cast<float>(random.Normal()));
    EXPECT_EQ(row.action[1], 0.5f * static_cast<float>(random.Normal()));
  }
}

TEST(SpreadNoise, SpreadsAndRefuses) {
  ActorConfig config;
  EXPECT_EQ(SpreadNoise(config, 3), (std::vector<double>{0.1, 0.1, 0.1}));
  config.noise_spread = NoiseSpread::kLinear;
  config.noise_min = 0.0;
  config.noise_max = 0.5;
  EXPECT_EQ(SpreadNoise(config, 3), (std::vector<double>{0.0, 0.25, 0.5}));
  EXPECT_EQ(SpreadNoise(config, 1), (std::vector<double>{0.0}));
  config.noise_spread = NoiseSpread::kGeometric;
  EXPECT_THROW((void)SpreadNoise(config, 3), base::Error);
  config.noise_min = 0.6;
  EXPECT_THROW((void)SpreadNoise(config, 3), base::Error);
}

}  // namespace
}  // namespace slalom::actor
