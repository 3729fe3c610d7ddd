#include "planners/mppi/rollouts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"

namespace slalom::planners {
namespace {

void FillRandomly(base::Random& random, Rollouts& rollouts) {
  for (float& v : rollouts.control_linear) v = static_cast<float>(random.Uniform(-1.5, 2.5));
  for (float& w : rollouts.control_angular) w = static_cast<float>(random.Uniform(-4.0, 4.0));
}

TEST(Rollouts, FollowTheDrivesEquations) {
  base::Random random(1);
  Rollouts rollouts(13, 40);
  FillRandomly(random, rollouts);
  const DriveLimits limits{0.15f, 0.4f, 0.05f};
  const double yaw = 2.2;
  Drive({static_cast<float>(std::cos(yaw)), static_cast<float>(std::sin(yaw)), 0.7f, -0.3f}, limits,
        rollouts);
  for (int b = 0; b < rollouts.batch_size; ++b) {
    double v = 0.7, w = -0.3, x = 0.0, y = 0.0, heading = yaw;
    for (int t = 0; t < rollouts.num_steps; ++t) {
      const std::size_t i = rollouts.Index(t, b);
      v = std::clamp<double>(rollouts.control_linear[i], v - 0.15, v + 0.15);
      w = std::clamp<double>(rollouts.control_angular[i], w - 0.4, w + 0.4);
      x += v * 0.05 * std::cos(heading + 0.5 * w * 0.05);
      y += v * 0.05 * std::sin(heading + 0.5 * w * 0.05);
      heading += w * 0.05;
      // Forty steps of float arithmetic on numbers up to 5: 40 * 5 * 6e-8 = 1.2e-5.
      EXPECT_NEAR(rollouts.linear[i], v, 1.2e-5);
      EXPECT_NEAR(rollouts.angular[i], w, 1.2e-5);
      EXPECT_NEAR(rollouts.x[i], x, 2e-5);
      EXPECT_NEAR(rollouts.y[i], y, 2e-5);
      EXPECT_NEAR(rollouts.cosine[i], std::cos(heading), 2e-5);
      EXPECT_NEAR(rollouts.sine[i], std::sin(heading), 2e-5);
    }
  }
}

TEST(Rollouts, AreTheSameBitsInAnyBatch) {
  base::Random random(2);
  Rollouts many(19, 30);
  FillRandomly(random, many);
  const RolloutStart start{0.6f, 0.8f, 0.1f, 0.2f};
  const DriveLimits limits{1.0f, 1.25f, 0.05f};
  Drive(start, limits, many);
  for (int b = 0; b < many.batch_size; ++b) {
    Rollouts one(1, 30);
    for (int t = 0; t < 30; ++t) {
      one.control_linear[t] = many.control_linear[many.Index(t, b)];
      one.control_angular[t] = many.control_angular[many.Index(t, b)];
    }
    Drive(start, limits, one);
    EXPECT_EQ(one.x.back(), many.x[many.Index(29, b)]);
    EXPECT_EQ(one.y.back(), many.y[many.Index(29, b)]);
    EXPECT_EQ(one.cosine.back(), many.cosine[many.Index(29, b)]);
  }
}

}  // namespace
}  // namespace slalom::planners
