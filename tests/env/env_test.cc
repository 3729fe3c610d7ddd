#include <gtest/gtest.h>

#include <vector>

#include "base/random.h"
#include "env/action.h"
#include "env/episode.h"
#include "env/observation.h"

namespace slalom::env {
namespace {

TEST(ActionTest, BoundsMapTheEndsToTheSpeedsOfThePaper) {
  const ActionBounds bounds;
  EXPECT_DOUBLE_EQ(bounds.linear_mps({-1.0f, 0.0f}), -1.0);
  EXPECT_DOUBLE_EQ(bounds.linear_mps({1.0f, 0.0f}), 2.0);
  EXPECT_DOUBLE_EQ(bounds.angular_radps({0.0f, -1.0f}), -3.14);
  // At rest, (0, 0) m/s, the linear part is not 0 but -1/3 (docs/original-system.md, section 1.3).
  EXPECT_FLOAT_EQ(bounds.Normalise(0.0, 0.0).linear, -1.0f / 3.0f);
  EXPECT_EQ(bounds.Normalise(0.0, 0.0).angular, 0.0f);
}

TEST(ActionTest, NormaliseUndoesTheMappingAndClips) {
  const ActionBounds bounds{.linear_min = -0.5, .linear_max = 1.0, .angular_max = 1.57};
  base::Random random(1);
  for (int i = 0; i < 10000; ++i) {
    const Action action{static_cast<float>(random.Uniform(-1, 1)),
                        static_cast<float>(random.Uniform(-1, 1))};
    const Action back = bounds.Normalise(bounds.linear_mps(action), bounds.angular_radps(action));
    ASSERT_NEAR(back.linear, action.linear, 1e-6);
    ASSERT_NEAR(back.angular, action.angular, 1e-6);
  }
  EXPECT_EQ(bounds.Normalise(9.0, -9.0), (Action{1.0f, -1.0f}));
}

TEST(EpisodeTest, ATimeLimitEndsWithoutTerminating) {
  const auto result = [](Outcome outcome) { return StepResult{.outcome = outcome}; };
  EXPECT_FALSE(result(Outcome::kRunning).ended());
  EXPECT_TRUE(result(Outcome::kTimeout).ended());
  EXPECT_FALSE(result(Outcome::kTimeout).terminated());
  EXPECT_TRUE(result(Outcome::kSuccess).terminated());
  EXPECT_TRUE(result(Outcome::kCollision).terminated());
  EXPECT_EQ(ToString(Outcome::kTimeout), "timeout");
}

TEST(ObservationTest, FramesOfABatchDoNotOverlap) {
  ObservationBatch batch;
  batch.Resize(3, 4);
  for (int i = 0; i < 3; ++i) {
    for (auto& range : batch.mutable_ranges(i)) range = static_cast<std::uint16_t>(i + 1);
    for (auto& x : batch.mutable_state(i)) x = static_cast<float>(-i - 1);
  }
  for (int i = 0; i < 3; ++i) {
    const FrameView frame = batch.frame(i);
    EXPECT_EQ(std::vector(frame.ranges_cm.begin(), frame.ranges_cm.end()),
              std::vector<std::uint16_t>(4, i + 1));
    EXPECT_EQ(std::vector(frame.state.begin(), frame.state.end()), std::vector<float>(4, -i - 1));
    EXPECT_EQ(batch.first[i], 1);
  }
}

}  // namespace
}  // namespace slalom::env
