#include <gtest/gtest.h>

#include <set>
#include <string>
#include <tuple>

#include "learner/algorithm.h"
#include "learner/learner.h"
#include "tests/learner/every_algorithm.h"
#include "tests/learner/every_encoder.h"
#include "tests/learner/random_rows.h"
#include "tests/support/every_value.h"

/// Every algorithm on every encoder.

namespace slalom::learner {
namespace {

using Combination = std::tuple<const char*, EncoderCase>;  // Algorithm, encoder.

class EncoderTest : public testing::TestWithParam<Combination> {
 protected:
  static constexpr int kBatch = 20;  // Two slices of different size.
  static constexpr int kBeams = 24;

  EncoderTest() {
    method_.learner.device = DeviceChoice::kCpu;
    method_.learner.algorithm = std::get<0>(GetParam());
    method_.learner.batch_size = kBatch;
    method_.learner.actor_learning_rate = 1e-3;
    method_.learner.critic_learning_rate = 1e-3;
    spec_.observation.num_beams = kBeams;
    spec_.network = std::get<1>(GetParam()).network;
    spec_.network.sectors = 12;
    if (spec_.network.encoder == nn::EncoderFamily::kTransformer) spec_.network.dropout = 0.1;
    spec_.distribution = DistributionOf(method_.learner);
  }

  void Train(Learner& learner, int begin, int end) const {
    for (int i = begin; i < end; ++i) {
      learner.Update(RandomRows(kBatch, spec_.network.history, kBeams, 100 + i).batches(), 0.0);
    }
  }

  static nn::TensorFile Saved(const Learner& learner) {
    nn::TensorFile file;
    file.source = "memory";
    learner.SaveState(file.tensors);
    return file;
  }

  MethodConfig method_;
  policy::PolicySpec spec_;
};

TEST_P(EncoderTest, LearnsAndGoesOnBitForBitAfterARestore) {
  Learner whole(method_, spec_, 5);
  const nn::TensorMap before = Saved(whole).tensors;
  Train(whole, 0, 3);
  Learner resumed(method_, spec_, 99);
  resumed.LoadState(Saved(whole));
  Train(whole, 3, 6);
  Train(resumed, 3, 6);
  EXPECT_EQ(Saved(whole).tensors, Saved(resumed).tensors);
  EXPECT_FALSE(Saved(whole).tensors.at("actor.parameters") == before.at("actor.parameters"));
  EXPECT_EQ(whole.FindFault(), std::nullopt);
}

TEST_P(EncoderTest, AnyNumberOfThreadsGivesTheSameBits) {
  spec_.network.dropout = 0.0;  // Which only one thread draws.
  const auto train = [&](int threads) {
    method_.learner.threads = threads;
    Learner learner(method_, spec_, 5);
    Train(learner, 0, 4);
    return Saved(learner).tensors;
  };
  const nn::TensorMap two = train(2);
  EXPECT_EQ(two, train(3));
  EXPECT_EQ(two, train(4));
}

TEST(EveryEncoder, IsOfEachKind) {
  std::set<nn::EncoderKind> kinds, found;
  for (const nn::EncoderFamily encoder : test::EveryValue<nn::EncoderFamily>()) {
    for (const nn::CnnAxis axis : test::EveryValue<nn::CnnAxis>()) {
      kinds.insert(nn::EncoderOf({.encoder = encoder, .cnn_axis = axis}));
    }
  }
  for (const EncoderCase& encoder : EveryEncoder()) found.insert(EncoderOf(encoder.network));
  EXPECT_EQ(found, kinds);
}

INSTANTIATE_TEST_SUITE_P(Combinations, EncoderTest,
                         testing::Combine(testing::ValuesIn(EveryAlgorithm()),
                                          testing::ValuesIn(EveryEncoder())),
                         [](const auto& test) {
                           return std::string(std::get<0>(test.param)) + "_" +
                                  std::get<1>(test.param).name;
                         });

}  // namespace
}  // namespace slalom::learner
