#include "policy/nn/feature_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "base/error.h"
#include "base/random.h"

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

TEST(FeatureMap, WithoutPoolingIsTheInterfacesObservation) {
  const env::ObservationSpec spec;
  base::Random random(1);
  for (int round = 0; round < 20; ++round) {
    const Frame frame = RandomFrame(spec.num_beams, random);
    std::vector<float> expected(spec.size());
    env::WriteObservation(spec, {frame.ranges_cm, frame.state}, expected);
    EXPECT_EQ(Write(FeatureMap(spec, {}), frame, false), expected);
  }
}

TEST(FeatureMap, PoolsByMinimumForEveryDivisor) {
  base::Random random(2);
  const env::ObservationSpec spec{.num_beams = 720};
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
  const env::ObservationSpec spec{.num_beams = 720};
  for (const int sectors : {0, 72, 90}) {
    for (const GoalTransform goal : {GoalTransform::kLinear, GoalTransform::kCentred}) {
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

TEST(FeatureMap, RefusesSectorsThatDoNotDivideTheBeams) {
  EXPECT_THROW(FeatureMap({}, {.sectors = 7}), base::Error);
  EXPECT_THROW(FeatureMap({}, {.sectors = 721}), base::Error);
}

}  // namespace
}  // namespace slalom::nn
