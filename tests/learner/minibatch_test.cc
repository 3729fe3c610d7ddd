#include "learner/minibatch.h"

#include <gtest/gtest.h>

#include "tests/learner/random_rows.h"

namespace slalom::learner {
namespace {

constexpr int kBatch = 9;
constexpr int kHistory = 3;
constexpr int kBeams = 24;

const nn::FeatureMap& Features() {
  static const nn::FeatureMap features({.num_beams = kBeams}, {.sectors = 12});
  return features;
}

/// The state of one sample as the feature map writes its frames, then the action.
std::vector<float> Expected(const replay::SampledRows& rows, int sample, bool mirrored) {
  const int size = Features().frame_size();
  std::vector<float> expected(kHistory * size);
  for (int age = 0; age < kHistory; ++age) {
    const int i = sample * kHistory + age;
    Features().Write(rows.ranges_cm[i], rows.state.data() + i * env::kStateSize, mirrored,
                     expected.data() + age * size);
  }
  expected.push_back(rows.action[2 * sample]);
  expected.push_back(mirrored ? -rows.action[2 * sample + 1] : rows.action[2 * sample + 1]);
  return expected;
}

std::vector<float> Row(const Minibatch& minibatch, int sample) {
  std::vector<float> row;
  for (const at::Tensor& t : {minibatch.features, minibatch.actions}) {
    const float* const begin = t.data_ptr<float>() + sample * t.stride(0);
    row.insert(row.end(), begin, begin + t.size(1));
  }
  return row;
}

TEST(MinibatchReader, LaysOutHistoryThenAction) {
  const RandomRows random_rows(kBatch, kHistory, kBeams, 1);
  Minibatch minibatch(kBatch, kHistory, Features().frame_size(), at::kCPU);
  MinibatchReader reader(Features(), kHistory, /*reward_scale=*/0.5, /*mirror=*/false,
                         /*discount_factor=*/0.75);
  base::Random random(1);
  reader.Read(random_rows.rows, random, minibatch);
  for (int i = 0; i < kBatch; ++i) {
    EXPECT_EQ(Row(minibatch, i), Expected(random_rows.rows, i, false));
    EXPECT_EQ(minibatch.reward.data_ptr<float>()[i], 0.5f * random_rows.rows.n_step_return[i]);
    EXPECT_EQ(minibatch.cost.data_ptr<float>()[i], random_rows.rows.cost_return[i]);
    EXPECT_EQ(minibatch.discount.data_ptr<float>()[i], 0.75f * random_rows.rows.discount[i]);
  }
  EXPECT_EQ(random.state(), base::Random(1).state()) << "drew without need";
}

TEST(MinibatchReader, CriticsMaySeeTheNewestFrameAndWhatNoSensorTells) {
  constexpr int kState = env::kStateSize + env::kPrivilegedSize;
  const RandomRows random_rows(kBatch, kHistory, {kBeams, kState}, 3);
  const replay::SampledRows& rows = random_rows.rows;
  const int size = Features().frame_size();
  Minibatch minibatch(kBatch, kHistory, size, at::kCPU, env::kActionSize, env::kPrivilegedSize);
  MinibatchReader reader(Features(), kHistory, 1.0, /*mirror=*/true, 1.0, env::kPrivilegedSize);
  base::Random random(1);
  reader.Read(rows, random, minibatch);
  minibatch.room.fill_(7.0f);
  ASSERT_EQ(minibatch.critic_features.size(1), size + env::kPrivilegedSize);
  ASSERT_EQ(minibatch.critic_input.size(1), size + env::kPrivilegedSize + env::kActionSize);
  int num_mirrored = 0;
  for (int i = 0; i < kBatch; ++i) {
    const float turn = minibatch.actions.data_ptr<float>()[2 * i + 1];
    const bool mirrored = turn != rows.action[2 * i + 1];
    num_mirrored += mirrored;
    const auto check = [&](const auto& scans, const auto& states, const at::Tensor& features,
                           const at::Tensor& critic_input) {
      std::vector<float> expected(static_cast<std::size_t>(kHistory) * size);
      const float* state = nullptr;
      for (int age = 0; age < kHistory; ++age) {
        state = states.data() + (i * kHistory + age) * kState;
        Features().Write(scans[i * kHistory + age], state, mirrored, expected.data() + age * size);
      }
      const float* const seen = features.data_ptr<float>() + i * features.stride(0);
      EXPECT_TRUE(std::equal(expected.begin(), expected.end(), seen));
      const float* told = critic_input.data_ptr<float>() + i * critic_input.stride(0);
      EXPECT_TRUE(std::equal(expected.end() - size, expected.end(), told));
      told += size;
      for (int j = 0; j < env::kPrivilegedSize; ++j) {
        const bool is_sided = j % 2 == 1 && j < env::kPrivilegedSize - env::kToldOfDrive;
        const float number = state[env::kStateSize + j];
        EXPECT_EQ(told[j], mirrored && is_sided ? -number : number) << j;
      }
    };
    check(rows.ranges_cm, rows.state, minibatch.features, minibatch.critic_input);
    check(rows.next_ranges_cm, rows.next_state, minibatch.next_features,
          minibatch.next_critic_input);
    const float* const end = minibatch.critic_input.data_ptr<float>() +
                             i * minibatch.critic_input.stride(0) + size + env::kPrivilegedSize;
    EXPECT_EQ(end[0], 7.0f);
    EXPECT_EQ(end[1], 7.0f);
  }
  EXPECT_GT(num_mirrored, 0);
  EXPECT_LT(num_mirrored, kBatch);
}

TEST(MinibatchReader, MirrorsWholeSamplesHalfTheTime) {
  const RandomRows random_rows(kBatch, kHistory, kBeams, 2);
  Minibatch minibatch(kBatch, kHistory, Features().frame_size(), at::kCPU);
  MinibatchReader reader(Features(), kHistory, 1.0, /*mirror=*/true, 1.0);
  base::Random random(1);
  int num_mirrored = 0;
  constexpr int kRounds = 100;
  for (int round = 0; round < kRounds; ++round) {
    reader.Read(random_rows.rows, random, minibatch);
    for (int i = 0; i < kBatch; ++i) {
      const std::vector<float> row = Row(minibatch, i);
      const bool mirrored = row == Expected(random_rows.rows, i, true);
      if (!mirrored) {
        EXPECT_EQ(row, Expected(random_rows.rows, i, false));
      }
      num_mirrored += mirrored;
    }
  }
  // 900 fair coins: standard deviation 15; five of them.
  EXPECT_NEAR(num_mirrored, kRounds * kBatch / 2, 75);
}

}  // namespace
}  // namespace slalom::learner
