#include "policy/nn/network_shape.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "base/error.h"
#include "tests/support/every_value.h"

namespace slalom::nn {
namespace {

TEST(NetworkShape, PaperActorHasItsNumberOfParameters) {
  EXPECT_EQ(ActorShape({}, 724).num_parameters(), 1'160'194);
}

// Worked out by hand from docs/original-system.md, section 3.3: W = 512, frames of F = 724, H of
// them.
TEST(NetworkShape, PaperEncodersHaveTheirNumbersOfParameters) {
  constexpr std::int64_t kW = 512, kF = 724;
  constexpr std::int64_t kHead = 2 * (kW * kW + kW) + 2 * kW + 2;
  // Weights of input and state and both biases, for three gates.
  constexpr std::int64_t kGru = 3 * kW * kF + 3 * kW * kW + 6 * kW + 2 * 3 * kW * kW + 6 * kW;
  // LayerNorm 2 W; query, key, value 3 W^2 + 3 W; output W^2 + W; LayerNorm 2 W; 4 W^2 + 4 W up and
  // 4 W^2 + W down.
  constexpr std::int64_t kBlock = 12 * kW * kW + 13 * kW;
  const auto count = [](EncoderFamily encoder, int history) {
    NetworkConfig config;
    config.encoder = encoder;
    config.history = history;
    return ActorShape(config, kF).num_parameters();
  };
  for (const int history : {1, 4, 8}) {
    EXPECT_EQ(count(EncoderFamily::kMlp, history), history * kF * kW + kW + kW * kW + kW + kHead);
    EXPECT_EQ(count(EncoderFamily::kCnn, history),
              3 * kF * kW + kW + history * kW * kW + kW + kHead);
    EXPECT_EQ(count(EncoderFamily::kGru, history), kGru + kHead);
    EXPECT_EQ(count(EncoderFamily::kTransformer, history),
              kF * kW + kW + history * kW + 2 * kW + 2 * kBlock + 2 * kW + kHead);
  }
  EXPECT_EQ(count(EncoderFamily::kMlp, 4), 2'272'258);
  EXPECT_EQ(count(EncoderFamily::kCnn, 4), 2'688'002);
  EXPECT_EQ(count(EncoderFamily::kGru, 4), 4'003'842);
  EXPECT_EQ(count(EncoderFamily::kTransformer, 4), 7'206'402);
}

TEST(NetworkShape, ConvolutionsOverBeamsHalveThePositions) {
  NetworkConfig config;
  config.encoder = EncoderFamily::kCnn;
  config.cnn_axis = CnnAxis::kBeams;
  config.encoder_layers = {32, 32, 256};
  config.head_layers = {};
  config.history = 3;
  // 720 beams -> 358 -> 178 positions; windows of 5 frames' ranges, then of 3 times 32 channels.
  EXPECT_EQ(ActorShape(config, 724).num_parameters(),
            32 * 5 * 3 + 32 + 32 * 3 * 32 + 32 + (178 * 32 + 3 * 4 + 1) * 256 + 257 * 2);
}

TEST(NetworkShape, SlotsOfEveryEncoderTileTheParameters) {
  for (const EncoderFamily encoder : test::EveryValue<EncoderFamily>()) {
    if (encoder == EncoderFamily::kMlp) continue;  // Its layers are the head's.
    NetworkConfig config;
    config.encoder = encoder;
    config.encoder_layers = {16, 16};
    config.history = 3;
    const NetworkShape shape = CriticShape(config, 10);
    std::int64_t offset = 0;
    std::set<std::string> names;
    for (const ParameterSlot& slot : shape.Slots()) {
      EXPECT_EQ(slot.offset, offset) << slot.name;
      offset += slot.size();
      EXPECT_TRUE(names.insert(slot.name).second) << slot.name;
    }
    EXPECT_EQ(offset, shape.num_parameters());
    EXPECT_EQ(shape.mlp.layer_inputs(0), 18) << "the head reads features and action";
  }
}

// The deviation of 16 * 48 numbers of deviation s is within s / sqrt(2 * 768) of s, 2.6 % of it;
// five times that is exceeded once in two million.
TEST(InitialiseParameters, TransformerBlocksStartAsTheOriginals) {
  NetworkConfig config;
  config.encoder = EncoderFamily::kTransformer;
  config.encoder_layers = {16};
  const NetworkShape shape = ActorShape(config, 10);
  std::vector<float> parameters(shape.num_parameters());
  base::Random random(1);
  InitialiseParameters(shape, random, parameters);
  for (const ParameterSlot& slot : shape.Slots()) {
    if (slot.name != "encoder.0.attention.query_key_value.weight") continue;
    double squares = 0.0;
    for (std::int64_t i = 0; i < slot.size(); ++i) {
      squares += std::pow(parameters[slot.offset + i], 2);
    }
    EXPECT_NEAR(std::sqrt(squares / static_cast<double>(slot.size())), 0.02, 0.02 * 5 * 0.026);
  }
}

TEST(CheckNetwork, NamesTheKeyOfWhatMakesNoNetwork) {
  const auto refusal = [](const NetworkConfig& config) -> std::string {
    try {
      ActorShape(config, 24);
    } catch (const base::Error& error) {
      return error.what();
    }
    return "";
  };
  NetworkConfig config;
  EXPECT_EQ(refusal(config), "");
  config.encoder = EncoderFamily::kCnn;
  EXPECT_EQ(refusal(config), "");
  config.encoder_layers = {8};
  EXPECT_THAT(refusal(config), testing::StartsWith("network.encoder_layers: found [8]"));
  config.cnn_axis = CnnAxis::kBeams;
  EXPECT_THAT(refusal(config), testing::StartsWith("network.encoder_layers: found [8]"));
  // 20 ranges -> 8 -> 3 -> 1, of which no window of 3 can be cut.
  config.encoder_layers = {4, 4, 4, 8};
  EXPECT_EQ(refusal(config), "");
  config.encoder_layers = {4, 4, 4, 4, 8};
  EXPECT_THAT(refusal(config), testing::HasSubstr("convolution 4 gets 1, expected 3 or more"));
  config.encoder = EncoderFamily::kGru;
  config.encoder_layers = {};
  EXPECT_THAT(refusal(config), testing::StartsWith("network.encoder_layers: found []"));
  config.encoder_layers = {8};
  config.encoder = EncoderFamily::kTransformer;
  EXPECT_EQ(refusal(config), "");
  config.encoder_layers = {16, 8};
  EXPECT_THAT(refusal(config), testing::HasSubstr("all equal"));
  config.encoder_layers = {12, 12};
  EXPECT_EQ(refusal(config),
            "network.attention_heads: found 8, expected a divisor of the width 12");
}

TEST(NetworkShape, CriticReadsTheActionBesideTheEncoder) {
  const MlpShape paper = CriticShape({}, 724).mlp;
  EXPECT_EQ(paper.layer_inputs(0), 724);
  EXPECT_EQ(paper.layer_inputs(1), 512);
  EXPECT_EQ(paper.layer_inputs(2), 514);
  const MlpShape fast = CriticShape({.encoder_layers = {}, .head_layers = {128, 128}}, 76).mlp;
  EXPECT_EQ(fast.layer_inputs(0), 78);
  EXPECT_EQ(fast.layer_inputs(1), 128);
}

TEST(NetworkShape, SlotsTileTheParameters) {
  const NetworkShape shape =
      CriticShape({.encoder_layers = {6}, .head_layers = {5}, .layer_norm = true}, 4);
  std::int64_t offset = 0;
  for (const ParameterSlot& slot : shape.Slots()) {
    EXPECT_EQ(slot.offset, offset) << slot.name;
    offset += slot.size();
  }
  EXPECT_EQ(offset, shape.num_parameters());
  // encoder 6 x 4 + 6, norm 12; head 5 x 8 + 5, norm 10; output 5 + 1
  EXPECT_EQ(offset, 30 + 12 + 45 + 10 + 6);
}

TEST(InitialiseParameters, FillsTheRangeOfLibTorchsDefault) {
  const NetworkShape shape =
      CriticShape({.encoder_layers = {64}, .head_layers = {64}, .layer_norm = true}, 100);
  std::vector<float> parameters(shape.num_parameters());
  base::Random random(1);
  InitialiseParameters(shape, random, parameters);
  for (const ParameterSlot& slot : shape.Slots()) {
    const auto begin = parameters.begin() + slot.offset;
    const auto [low, high] = std::minmax_element(begin, begin + slot.size());
    if (slot.initial.kind == InitialValues::Kind::kConstant) {
      EXPECT_EQ(*low, *high);
      EXPECT_EQ(*low, slot.name.ends_with("weight") ? 1.0f : 0.0f);
      continue;
    }
    const bool is_first = slot.name.starts_with("encoder.0");
    const double bound = 1.0 / std::sqrt(is_first                          ? 100.0
                                         : slot.name.starts_with("head.0") ? 66.0
                                                                           : 64.0);
    EXPECT_LE(*high, bound);
    EXPECT_GE(*low, -bound);
    // The largest of n uniform numbers misses the last 20 % with probability 0.9^n, 1e-3 for n
    // = 64.
    if (slot.size() >= 64) {
      EXPECT_GT(*high, 0.8 * bound) << slot.name;
      EXPECT_LT(*low, -0.8 * bound) << slot.name;
    }
  }
}

}  // namespace
}  // namespace slalom::nn
