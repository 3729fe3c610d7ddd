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

/// Both stacks of one sample as the feature map writes their frames, the newer one last, then the
/// action.
std::vector<float> Expected(const replay::SampledRows& rows, int sample, bool mirrored) {
  const int size = Features().frame_size();
  std::vector<float> expected(2 * kHistory * size);
  for (int age = 0; age < kHistory; ++age) {
    const int i = sample * kHistory + age;
    float* const frame = expected.data() + age * size;
    Features().Write(rows.ranges_cm[i], rows.state.data() + i * env::kStateSize, mirrored, frame);
    Features().Write(rows.next_ranges_cm[i], rows.next_state.data() + i * env::kStateSize, mirrored,
                     frame + kHistory * size);
  }
  expected.push_back(rows.action[2 * sample]);
  expected.push_back(mirrored ? -rows.action[2 * sample + 1] : rows.action[2 * sample + 1]);
  return expected;
}

std::vector<float> Row(const Minibatch& minibatch, int sample) {
  std::vector<float> row;
  for (const at::Tensor& t : {minibatch.features, minibatch.next_features, minibatch.actions}) {
    const float* const begin = t.data_ptr<float>() + sample * t.stride(0);
    row.insert(row.end(), begin, begin + t.size(1));
  }
  return row;
}

TEST(MinibatchReader, LaysOutHistoryThenAction) {
  RandomRows random_rows(kBatch, kHistory, kBeams, 1);
  for (int i = 0; i < kBatch; ++i) random_rows.rows.weight[i] = 1.0f / static_cast<float>(1 + i);
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
    EXPECT_EQ(minibatch.weight.data_ptr<float>()[i], random_rows.rows.weight[i]);
  }
  EXPECT_EQ(random.state(), base::Random(1).state()) << "drew without need";
}

TEST(MinibatchReader, ReadsTheSameByAnyNumberOfThreads) {
  constexpr int kMany = 50;  // Several times what a thread reads at a time, and some more.
  const RandomRows random_rows(kMany, kHistory, kBeams, 3);
  const auto read = [&](base::ParallelFor* parallel) {
    Minibatch minibatch(kMany, kHistory, Features().frame_size(), at::kCPU);
    minibatch.parallel = parallel;
    MinibatchReader reader(Features(), kHistory, 1.0, /*mirror=*/true, 1.0);
    base::Random random(1), coins(1);
    std::vector<std::vector<float>> all;
    for (int round = 0; round < 2; ++round) {
      reader.Read(random_rows.rows, random, minibatch);
      for (int i = 0; i < kMany; ++i) {
        all.push_back(Row(minibatch, i));
        EXPECT_EQ(all.back(), Expected(random_rows.rows, i, (coins.NextU64() >> 63) != 0));
        for (const at::Tensor& t : {minibatch.reward, minibatch.cost, minibatch.discount}) {
          all.back().push_back(t.data_ptr<float>()[i]);
        }
      }
    }
    return all;
  };
  base::ParallelFor two(2), three(3);
  const auto alone = read(nullptr);
  EXPECT_EQ(alone, read(&two));
  EXPECT_EQ(alone, read(&three));
}

TEST(Minibatch, SlicesCoverItsRowsInTheirOrder) {
  base::ParallelFor parallel(2);
  for (const int batch : {1, 8, 9, 16, 20, 100, 128, 1000}) {
    Minibatch minibatch(batch, 1, 4, at::kCPU);
    EXPECT_EQ(minibatch.Slices().size(), 1u);
    minibatch.parallel = &parallel;
    std::int64_t end = 0;
    for (const RowSlice& slice : minibatch.Slices()) {
      EXPECT_EQ(slice.begin, end);
      EXPECT_GE(slice.size, 1);
      EXPECT_EQ(slice.begin % 8, 0);
      end += slice.size;
    }
    EXPECT_EQ(end, batch);
    EXPECT_EQ(minibatch.Slices().size() > 1, batch > 8) << batch;
  }
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
      if (!mirrored) EXPECT_EQ(row, Expected(random_rows.rows, i, false));
      num_mirrored += mirrored;
    }
  }
  // 900 fair coins: standard deviation 15; five of them.
  EXPECT_NEAR(num_mirrored, kRounds * kBatch / 2, 75);
}

}  // namespace
}  // namespace slalom::learner
