#include "policy/nn/feature_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/random.h"
#include "policy/nn/model_shape.h"

namespace slalom::nn {
namespace {

struct Frame {
  std::vector<std::uint16_t> ranges_cm;
  std::array<float, env::kStateSize> state;
};

Frame RandomFrame(int num_beams, base::Random& random) {
  Frame frame;
  for (int i = 0; i < num_beams; ++i) {
    frame.ranges_cm.push_back(static_cast<std::uint16_t>(random.UniformInt(700)));
  }
  for (float& value : frame.state) value = static_cast<float>(random.Uniform(-5.0, 5.0));
  return frame;
}

std::vector<float> Write(const FeatureMap& map, const Frame& frame, bool mirrored) {
  std::vector<float> features(map.frame_size());
  map.Write(frame.ranges_cm.data(), frame.state.data(), mirrored, features.data());
  return features;
}

/// The observation of the paper, number by number.
std::vector<float> PapersObservation(const Frame& frame) {
  std::vector<float> observation;
  for (const std::uint16_t range_cm : frame.ranges_cm) {
    observation.push_back(static_cast<float>(std::min<int>(range_cm, 500)) * (2.0f / 500.0f) -
                          1.0f);
  }
  observation.push_back(frame.state[0] / 5.0f - 1.0f);
  observation.push_back(frame.state[1] / 5.0f - 1.0f);
  observation.insert(observation.end(), frame.state.begin() + 2, frame.state.end());
  return observation;
}

TEST(FeatureMap, ByDefaultIsTheObservationOfThePaper) {
  base::Random random(1);
  for (int round = 0; round < 20; ++round) {
    const Frame frame = RandomFrame(720, random);
    EXPECT_EQ(Write(FeatureMap({}, {}), frame, false), PapersObservation(frame));
  }
  const Frame frame{{0, 250, 3000}, {10.0f, 0.0f, -0.25f, 0.5f}};
  EXPECT_EQ(Write(FeatureMap({{}, 3}, {}), frame, false),
            (std::vector<float>{-1.0f, 0.0f, 1.0f, 1.0f, -1.0f, -0.25f, 0.5f}));
}

TEST(FeatureMap, PoolsByMinimumForEveryDivisor) {
  base::Random random(2);
  const env::ObservationSpec spec;
  for (const int sectors : {1, 2, 8, 36, 72, 80, 90, 144, 180, 360, 720}) {
    const FeatureMap map(spec, {.sectors = sectors, .range_transform = RangeTransform::kInverse});
    const Frame frame = RandomFrame(spec.num_beams, random);
    const std::vector<float> features = Write(map, frame, false);
    const int group = spec.num_beams / sectors;
    for (int i = 0; i < sectors; ++i) {
      const auto begin = frame.ranges_cm.begin() + i * group;
      const double nearest_m = std::min(*std::min_element(begin, begin + group) * 0.01, 5.0);
      // Three float operations on numbers of at most 3.
      EXPECT_NEAR(features[i], 0.6 / (nearest_m + 0.2) - 0.8, 4 * 3 * 0x1p-24)
          << sectors << " sectors, sector " << i;
    }
  }
}

TEST(FeatureMap, MirrorTurnsTheSceneLeftForRight) {
  base::Random random(3);
  const env::ObservationSpec spec;
  for (const int sectors : {0, 72, 90}) {
    for (const GoalTransform goal :
         {GoalTransform::kLinear, GoalTransform::kCentred, GoalTransform::kBounded}) {
      const FeatureMap map(spec, {.sectors = sectors, .goal_transform = goal});
      const Frame frame = RandomFrame(spec.num_beams, random);
      Frame mirror = frame;
      std::reverse(mirror.ranges_cm.begin(), mirror.ranges_cm.end());
      mirror.state[1] = -mirror.state[1];
      mirror.state[3] = -mirror.state[3];
      EXPECT_EQ(Write(map, frame, true), Write(map, mirror, false));
      EXPECT_NE(Write(map, frame, true), Write(map, frame, false));
    }
  }
}

TEST(FeatureMap, CentredGoalIsOddInY) {
  const FeatureMap map({}, {.sectors = 72, .goal_transform = GoalTransform::kCentred});
  Frame frame{std::vector<std::uint16_t>(720, 100), {10.0f, 2.5f, 0.1f, -0.2f}};
  const std::vector<float> features = Write(map, frame, false);
  EXPECT_THAT((std::vector<float>(features.end() - 4, features.end())),
              testing::ElementsAre(1.0f, 0.5f, 0.1f, -0.2f));
}

TEST(FeatureMap, BoundedGoalKeepsItsDirectionAtAnyDistance) {
  constexpr double kScale = 4.0;
  env::ObservationSpec spec;
  spec.goal_scale = kScale;
  const FeatureMap map(spec, {.sectors = 72, .goal_transform = GoalTransform::kBounded});
  base::Random random(8);
  double last = -1.0;
  for (const double distance : {0.0, 0.01, 0.4, 3.0, 10.0, 20.0, 50.0, 1000.0}) {
    const double bearing = random.Uniform(-3.0, 3.0);
    const auto x = static_cast<float>(distance * std::cos(bearing));
    const auto y = static_cast<float>(distance * std::sin(bearing));
    const Frame frame{std::vector<std::uint16_t>(720, 100), {x, y, 0.1f, -0.2f}};
    const std::vector<float> features = Write(map, frame, false);
    const float* const goal = features.data() + 72;
    const double length = std::hypot(goal[0], goal[1]);
    // Six float operations on numbers of at most 1 beside the rounding of x and y.
    EXPECT_NEAR(length, distance / (distance + kScale), 8 * 0x1p-24);
    if (distance > 0.0) EXPECT_NEAR(std::atan2(goal[1], goal[0]), bearing, 1e-6);
    EXPECT_GT(length, last);
    EXPECT_LT(length, 1.0);
    last = length;
    EXPECT_EQ(goal[2], 0.1f);
    EXPECT_EQ(goal[3], -0.2f);
  }
}

TEST(FeatureMap, AModelThatKnowsSuccessFindsItInTheGoalsFeatures) {
  env::ObservationSpec spec;
  spec.goal_scale = 4.0;
  const GoalRule goal{.radius = 0.5, .reward = 1.0};
  TransitionModelConfig model;
  model.kind = ModelKind::kDeterministic;
  model.success = ModelSuccess::kKnown;
  base::Random random(9);
  for (const GoalTransform transform :
       {GoalTransform::kLinear, GoalTransform::kCentred, GoalTransform::kBounded}) {
    const NetworkConfig network{.sectors = 72, .goal_transform = transform};
    const FeatureMap map(spec, network);
    const ModelShape shape = MakeModelShape(model, network, map.frame_size(), spec, goal);
    for (int i = 0; i < 200; ++i) {
      const auto x = static_cast<float>(random.Uniform(-0.8, 0.8));
      const auto y = static_cast<float>(random.Uniform(-0.8, 0.8));
      const double distance = std::hypot(x, y);
      if (std::abs(distance - goal.radius) < 1e-5) continue;
      const Frame frame{std::vector<std::uint16_t>(720, 100), {x, y, 0.0f, 0.0f}};
      EXPECT_EQ(shape.IsSuccess(Write(map, frame, false).data()), distance < goal.radius)
          << base::EnumName(transform) << " at " << distance;
    }
  }
}

/// A course's spec with speeds and three commands.
env::ObservationSpec LongSpec() {
  env::ObservationSpec spec{{.speeds = true, .commands = 3}};
  spec.state_size = env::StateSize(spec);
  return spec;
}

TEST(FeatureMap, WhatFollowsTheGoalIsSeenAsItIsAndItsTurnsAreMirrored) {
  const env::ObservationSpec spec = LongSpec();
  ASSERT_EQ(spec.state_size, 10);
  const std::vector<std::uint16_t> ranges_cm(720, 100);
  const std::vector<float> state = {10.0f, 2.5f, 0.1f, -0.2f, 0.3f, -0.4f, 0.5f, 0.6f, -0.7f, 0.8f};
  for (const GoalTransform transform : {GoalTransform::kCentred, GoalTransform::kBounded}) {
    const FeatureMap map(spec, {.sectors = 72, .goal_transform = transform});
    ASSERT_EQ(map.frame_size(), 82);
    std::vector<float> features(82), mirrored(82);
    map.Write(ranges_cm.data(), state.data(), false, features.data());
    map.Write(ranges_cm.data(), state.data(), true, mirrored.data());
    for (std::size_t i = 2; i < state.size(); ++i) EXPECT_EQ(features[72 + i], state[i]);
    for (std::size_t i = 0; i < state.size(); ++i) {
      EXPECT_EQ(mirrored[72 + i], i % 2 == 0 ? features[72 + i] : -features[72 + i]) << i;
    }
  }
  // The paper's map of the same frame.
  const FeatureMap plain(spec, {});
  std::vector<float> features(plain.frame_size());
  plain.Write(ranges_cm.data(), state.data(), false, features.data());
  EXPECT_EQ(features[720], 1.0f);
  EXPECT_EQ(features[721], -0.5f);
  for (std::size_t i = 2; i < state.size(); ++i) EXPECT_EQ(features[720 + i], state[i]);
}

TEST(FeatureMap, MirrorLeavesWhatHasNoSide) {
  env::ObservationSpec spec;
  spec.privileged = true;
  spec.state_size = env::StateSize(spec);
  const FeatureMap map(spec, {.sectors = 72});
  const std::vector<std::uint16_t> ranges_cm(720, 100);
  std::vector<float> state(static_cast<std::size_t>(spec.state_size));
  for (std::size_t i = 0; i < state.size(); ++i) state[i] = 0.1f + static_cast<float>(i);
  std::vector<float> mirrored(map.frame_size());
  map.Write(ranges_cm.data(), state.data(), true, mirrored.data());
  const std::size_t sided = state.size() - 6;  // The drive has none.
  for (std::size_t i = 2; i < state.size(); ++i) {
    EXPECT_EQ(mirrored[72 + i], i < sided && i % 2 == 1 ? -state[i] : state[i]) << i;
  }
}

TEST(FeatureMap, RefusesWhatAStateMakesImpossible) {
  env::ObservationSpec spec = LongSpec();
  spec.state_size = 8;
  EXPECT_THROW(FeatureMap(spec, {.sectors = 72}), base::Error);
  spec = LongSpec();
  const NetworkConfig beams{
      .encoder = EncoderFamily::kCnn, .encoder_layers = {4, 8}, .cnn_axis = CnnAxis::kBeams};
  EXPECT_THROW(FeatureMap(spec, beams), base::Error);
  EXPECT_NO_THROW(FeatureMap({}, beams));
  TransitionModelConfig model;
  model.kind = ModelKind::kDeterministic;
  EXPECT_THROW(MakeModelShape(model, {}, 730, spec), base::Error);
  EXPECT_NO_THROW(MakeModelShape(model, {}, 724));
}

TEST(FeatureMap, RefusesSectorsThatDoNotDivideTheBeams) {
  EXPECT_THROW(FeatureMap({}, {.sectors = 7}), base::Error);
  EXPECT_THROW(FeatureMap({}, {.sectors = 721}), base::Error);
}

}  // namespace
}  // namespace slalom::nn
