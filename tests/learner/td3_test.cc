#include "learner/td3.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/error.h"
#include "tests/learner/random_rows.h"

namespace slalom::learner {
namespace {

policy::PolicySpec SmallSpec() {
  policy::PolicySpec spec;
  spec.observation.num_beams = 24;
  spec.network.encoder_layers = {16};
  spec.network.head_layers = {16};
  spec.network.sectors = 12;
  spec.network.layer_norm = true;
  return spec;
}

Td3Config SmallConfig() {
  Td3Config config;
  config.device = "cpu";
  config.batch_size = 16;
  config.actor_learning_rate = 1e-3;
  config.critic_learning_rate = 1e-3;
  config.mirror = true;
  config.average_rate = 0.01;
  return config;
}

void Train(Td3& td3, int begin, int end) {
  for (int i = begin; i < end; ++i) {
    td3.Update(RandomRows(16, 1, 24, 100 + i).rows, i / 100.0);
  }
}

policy::TensorFile Saved(const Td3& td3) {
  policy::TensorFile file;
  file.source = "memory";
  td3.SaveState(file.tensors);
  return file;
}

TEST(Td3, IsAFunctionOfItsSeed) {
  Td3 a(SmallConfig(), SmallSpec(), 5), b(SmallConfig(), SmallSpec(), 5),
      c(SmallConfig(), SmallSpec(), 6);
  for (Td3* td3 : {&a, &b, &c}) Train(*td3, 0, 10);
  EXPECT_EQ(Saved(a).tensors, Saved(b).tensors);
  EXPECT_NE(*a.Snapshot().weights, *c.Snapshot().weights);
}

TEST(Td3, GoesOnBitForBitAfterARestore) {
  // 7 is odd, so the next update is one of those that move the actor.
  Td3 whole(SmallConfig(), SmallSpec(), 5);
  Train(whole, 0, 7);
  Td3 resumed(SmallConfig(), SmallSpec(), 99);
  resumed.LoadState(Saved(whole));
  Train(whole, 7, 20);
  Train(resumed, 7, 20);
  EXPECT_EQ(Saved(whole).tensors, Saved(resumed).tensors);
  EXPECT_EQ(*whole.AveragedSnapshot().weights, *resumed.AveragedSnapshot().weights);
  EXPECT_EQ(whole.ReadStats().critic_loss, resumed.ReadStats().critic_loss);
}

TEST(Td3, RefusesStateOfAnotherNetwork) {
  Td3 td3(SmallConfig(), SmallSpec(), 5);
  policy::PolicySpec other = SmallSpec();
  other.network.head_layers = {8};
  EXPECT_THROW(td3.LoadState(Saved(Td3(SmallConfig(), other, 5))), base::Error);
  policy::TensorFile incomplete = Saved(td3);
  incomplete.tensors.erase("critics.adam.second_moment");
  EXPECT_THROW(td3.LoadState(incomplete), base::Error);
}

TEST(Td3, TargetsStandStillBetweenActorUpdates) {
  Td3 td3(SmallConfig(), SmallSpec(), 5);
  const policy::TensorMap before = Saved(td3).tensors;
  EXPECT_EQ(before.at("critics.parameters"), before.at("critics.target_parameters"));
  EXPECT_EQ(before.at("actor.parameters"), before.at("actor.target_parameters"));
  Train(td3, 0, 1);
  const policy::TensorMap after_one = Saved(td3).tensors;
  EXPECT_NE(after_one.at("critics.parameters"), before.at("critics.parameters"));
  for (const char* name : {"critics.target_parameters", "actor.parameters",
                           "actor.target_parameters", "actor.average_parameters"}) {
    EXPECT_EQ(after_one.at(name), before.at(name)) << name;
  }
  Train(td3, 1, 2);
  const policy::TensorMap after_two = Saved(td3).tensors;
  for (const char* name : {"critics.target_parameters", "actor.parameters",
                           "actor.target_parameters", "actor.average_parameters"}) {
    EXPECT_NE(after_two.at(name), before.at(name)) << name;
  }
}

TEST(Td3, LearningRatesFallWithProgress) {
  Td3Config config = SmallConfig();
  config.final_learning_rate_fraction = 0.0;
  Td3 td3(config, SmallSpec(), 5);
  const policy::TensorMap before = Saved(td3).tensors;
  td3.Update(RandomRows(16, 1, 24, 1).rows, /*progress=*/1.0);
  EXPECT_EQ(Saved(td3).tensors.at("critics.parameters"), before.at("critics.parameters"));
}

TEST(Td3, ReportsNumbersThatAreNotFinite) {
  Td3 td3(SmallConfig(), SmallSpec(), 5);
  Train(td3, 0, 4);
  EXPECT_TRUE(td3.healthy());
  RandomRows bad(16, 1, 24, 1);
  bad.rows.n_step_return[3] = std::numeric_limits<float>::quiet_NaN();
  td3.Update(bad.rows, 0.0);
  ASSERT_FALSE(td3.healthy());
  EXPECT_THAT(*td3.FindFault(), testing::HasSubstr("critics"));
}

TEST(Td3, ReportsValuesBeyondTheLimit) {
  Td3Config config = SmallConfig();
  config.divergence_limit = 1.0;
  config.reward_scale = 1000.0;
  config.critic_learning_rate = 0.1;
  Td3 td3(config, SmallSpec(), 5);
  Train(td3, 0, 50);
  td3.ReadStats();
  ASSERT_FALSE(td3.healthy());
  EXPECT_THAT(*td3.FindFault(), testing::HasSubstr("divergence_limit"));
}

TEST(Td3, WithoutAveragingTheAverageIsTheActor) {
  Td3Config config = SmallConfig();
  config.average_rate = 0.0;
  Td3 td3(config, SmallSpec(), 5);
  Train(td3, 0, 4);
  EXPECT_EQ(*td3.AveragedSnapshot().weights, *td3.Snapshot().weights);
  EXPECT_EQ(td3.Snapshot().version, 4);
}

Td3Config Prioritized(Td3Config config) {
  config.prioritized = true;
  return config;
}

TEST(Td3, WeightsOfOneChangeNothing) {
  Td3 uniform(SmallConfig(), SmallSpec(), 5),
      prioritized(Prioritized(SmallConfig()), SmallSpec(), 5);
  for (Td3* td3 : {&uniform, &prioritized}) Train(*td3, 0, 10);
  EXPECT_EQ(*uniform.Snapshot().weights, *prioritized.Snapshot().weights);
}

// A batch in which half of the samples weigh nothing teaches what the other half alone does, at
// half the size of the gradient, which Adam does not see: its step is the same but for epsilon.
TEST(Td3, SamplesCountByTheirWeights) {
  Td3Config config = Prioritized(SmallConfig());
  config.mirror = false;
  config.target_noise = 0.0;
  Td3 whole(config, SmallSpec(), 5);
  RandomRows rows(16, 1, 24, 1);
  for (int i = 8; i < 16; ++i) rows.rows.weight[i] = 0.0f;
  config.batch_size = 8;
  Td3 half(config, SmallSpec(), 5);
  RandomRows first(16, 1, 24, 1);
  first.rows.batch = 8;
  whole.Update(rows.rows, 0.0);
  half.Update(first.rows, 0.0);
  const auto saved = [](const Td3& td3) {
    std::vector<float> values(Saved(td3).tensors.at("critics.parameters").bytes.size() / 4);
    Saved(td3).Read("critics.parameters", std::span(values));
    return values;
  };
  const auto a = saved(whole), b = saved(half);
  ASSERT_EQ(a.size(), b.size());
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
  }
  // A step is at most the learning rate, 1e-3. Where a gradient g is not far above Adam's epsilon,
  // halving it changes the step by up to epsilon / g of it.
  EXPECT_LT(largest, 1e-3 * 0.1);
  Td3 other(config, SmallSpec(), 5);
  EXPECT_NE(saved(other), b) << "the update did nothing";
}

TEST(Td3, ErrorsAreThoseOfTheCritics) {
  Td3Config config = Prioritized(SmallConfig());
  config.mirror = false;
  config.critic_learning_rate = 0.0;
  Td3 td3(config, SmallSpec(), 5);
  RandomRows rows(16, 1, 24, 1);
  // Where the window ended, y is the reward alone: a reward that is larger by 3 moves the error so.
  td3.Update(rows.rows, 0.0);
  const std::vector<float> before(td3.Errors().begin(), td3.Errors().end());
  for (int i = 0; i < 16; ++i) rows.rows.n_step_return[i] += 30.0f;
  td3.Update(rows.rows, 0.0);
  const auto after = td3.Errors();
  for (int i = 0; i < 16; i += 4) {
    ASSERT_EQ(rows.rows.discount[i], 0.0f);
    // |q - (r + 30)| with |q - r| < 30: 30 - (q - r), and before it was |q - r|.
    EXPECT_NEAR(
        std::min(std::abs(after[i] - 30.0f - before[i]), std::abs(after[i] - 30.0f + before[i])),
        0.0, 0.5)
        << i;
    EXPECT_GT(after[i], 20.0f);
  }
}

}  // namespace
}  // namespace slalom::learner
