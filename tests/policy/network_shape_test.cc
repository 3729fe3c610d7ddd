#include "policy/network_shape.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace slalom::policy {
namespace {

TEST(NetworkShape, PaperActorHasItsNumberOfParameters) {
  EXPECT_EQ(ActorShape({}, 724).num_parameters(), 1'160'194);
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
}  // namespace slalom::policy
