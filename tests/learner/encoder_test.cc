#include <gtest/gtest.h>

#include <string>
#include <tuple>

#include "learner/algorithm.h"
#include "learner/learner.h"
#include "tests/learner/every_algorithm.h"
#include "tests/learner/random_rows.h"

/// Every algorithm on every encoder.

namespace slalom::learner {
namespace {

using Combination = std::tuple<const char*, const char*>;  // Algorithm, encoder.

class EncoderTest : public testing::TestWithParam<Combination> {
 protected:
  static constexpr int kBatch = 8;
  static constexpr int kHistory = 3;
  static constexpr int kBeams = 24;

  EncoderTest() {
    method_.learner.device = DeviceChoice::kCpu;
    method_.learner.algorithm = std::get<0>(GetParam());
    method_.learner.batch_size = kBatch;
    method_.learner.actor_learning_rate = 1e-3;
    method_.learner.critic_learning_rate = 1e-3;
    spec_.observation.num_beams = kBeams;
    spec_.network.history = kHistory;
    spec_.network.sectors = 12;
    spec_.network.encoder_layers = {16, 16};
    spec_.network.head_layers = {16};
    const std::string encoder = std::get<1>(GetParam());
    SLALOM_CHECK(base::ParseEnum(encoder == "beams" ? "cnn" : encoder, spec_.network.encoder));
    if (encoder == "beams") spec_.network.cnn_axis = nn::CnnAxis::kBeams;
    if (encoder == "transformer") spec_.network.dropout = 0.1;
    spec_.distribution = DistributionOf(method_.learner);
  }

  void Train(Learner& learner, int begin, int end) const {
    for (int i = begin; i < end; ++i) {
      learner.Update(RandomRows(kBatch, kHistory, kBeams, 100 + i).batches(), 0.0);
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

INSTANTIATE_TEST_SUITE_P(Combinations, EncoderTest,
                         testing::Combine(testing::ValuesIn(EveryAlgorithm()),
                                          testing::Values("mlp", "cnn", "beams", "gru",
                                                          "transformer")),
                         [](const auto& test) {
                           return std::string(std::get<0>(test.param)) + "_" +
                                  std::get<1>(test.param);
                         });

}  // namespace
}  // namespace slalom::learner
