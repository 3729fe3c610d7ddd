#include "train/rate_limiter.h"

#include <gtest/gtest.h>

#include "base/random.h"

namespace slalom::train {
namespace {

TEST(RateLimiterTest, NothingIsDueBeforeLearningStarts) {
  RateLimiter limiter(0.25, 100);
  EXPECT_FALSE(limiter.update_due());
  limiter.AddSteps(103);
  EXPECT_FALSE(limiter.update_due());
  limiter.AddSteps(1);
  EXPECT_TRUE(limiter.update_due());
  limiter.AddUpdate();
  EXPECT_FALSE(limiter.update_due());
}

TEST(RateLimiterTest, GreedyUpdatesHoldTheRatioWhateverTheChunks) {
  base::Random random(1);
  for (const double ratio : {1.0 / 64, 0.25, 1.0, 3.0}) {
    RateLimiter limiter(ratio, 500);
    for (int chunk = 0; chunk < 300; ++chunk) {
      limiter.AddSteps(static_cast<std::int64_t>(random.UniformInt(100)));
      while (limiter.update_due()) limiter.AddUpdate();
      const double earned =
          ratio * static_cast<double>(std::max<std::int64_t>(0, limiter.steps() - 500));
      EXPECT_LE(static_cast<double>(limiter.updates()), earned);
      EXPECT_GT(static_cast<double>(limiter.updates()), earned - 1.0);
    }
  }
}

TEST(RateLimiterTest, RestoreGoesOnWhereItStood) {
  RateLimiter limiter(0.5, 0);
  limiter.Restore(100, 50);
  EXPECT_FALSE(limiter.update_due());
  limiter.AddSteps(2);
  EXPECT_TRUE(limiter.update_due());
}

}  // namespace
}  // namespace slalom::train
