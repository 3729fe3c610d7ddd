#include "planners/teb/timed_band.h"

#include <gtest/gtest.h>

#include "base/random.h"

namespace slalom::planners {
namespace {

TimedBand StraightBand(int num_poses, double spacing, double dt) {
  TimedBand band;
  for (int i = 0; i < num_poses; ++i) band.poses.push_back({{i * spacing, 0.0}, 0.0});
  band.dts.assign(static_cast<std::size_t>(num_poses - 1), dt);
  return band;
}

TEST(TimedBand, IsMadeInTheTimesThatTheLimitsAllow) {
  const std::vector<base::Vec2> points = {{0.0, 0.0}, {1.2, 0.0}, {1.2, 0.6}};
  const TimedBand band = MakeBand(points, 0.0, base::kPi / 2.0, 0.6, 0.3, 3);
  ASSERT_EQ(band.poses.size(), 3u);
  // The middle pose heads for the last one: a quarter turn takes longer than 1.2 m.
  EXPECT_NEAR(band.poses[1].yaw, base::kPi / 2.0, 1e-12);
  EXPECT_NEAR(band.dts[0], base::kPi / 2.0 / 0.3, 1e-12);
  EXPECT_NEAR(band.dts[1], 1.0, 1e-12);
}

TEST(TimedBand, HasItsLeastNumberOfPoses) {
  const std::vector<base::Vec2> points = {{0.0, 0.0}, {1.0, 0.0}};
  const TimedBand band = MakeBand(points, 0.0, 0.0, 0.5, 1.0, 5);
  ASSERT_EQ(band.poses.size(), 5u);
  EXPECT_NEAR(band.poses[1].p.x, 0.5, 1e-12);
  EXPECT_NEAR(band.Duration(), 2.0, 1e-12);
}

TEST(TimedBand, ResizingEvensOutTheTimes) {
  base::Random random(1);
  for (int trial = 0; trial < 100; ++trial) {
    TimedBand band = StraightBand(20, 0.1, 0.3);
    for (double& dt : band.dts) dt = random.Uniform(0.02, 1.5);
    const double duration = band.Duration();
    const base::Pose2 goal = band.poses.back();
    for (int pass = 0; pass < 4; ++pass) ResizeBand(0.3, 0.1, 3, 500, band);
    EXPECT_EQ(band.poses.size(), band.dts.size() + 1);
    EXPECT_NEAR(band.Duration(), duration, 1e-9);
    EXPECT_EQ(band.poses.front(), base::Pose2{});
    EXPECT_EQ(band.poses.back(), goal);
    for (std::size_t i = 0; i + 1 < band.dts.size(); ++i) {
      EXPECT_GE(band.dts[i], 0.2 - 1e-9);
      EXPECT_LE(band.dts[i], 0.4 + 1e-9);
    }
    for (std::size_t i = 0; i + 1 < band.poses.size(); ++i) {
      EXPECT_LE(band.poses[i].p.x, band.poses[i + 1].p.x);
    }
  }
}

TEST(TimedBand, ResizingKeepsToTheNumbersOfSamples) {
  TimedBand few = StraightBand(6, 0.1, 0.01);
  ResizeBand(0.3, 0.1, 4, 500, few);
  EXPECT_EQ(few.dts.size(), 4u);
  TimedBand many = StraightBand(3, 1.0, 5.0);
  ResizeBand(0.3, 0.1, 3, 10, many);
  EXPECT_EQ(many.dts.size(), 10u);
}

TEST(TimedBand, DropsThePosesPassed) {
  TimedBand band = StraightBand(10, 0.1, 0.3);
  MoveEnds({{0.32, 0.02}, 0.1}, {{1.0, 0.1}, 0.2}, 3, band);
  ASSERT_EQ(band.poses.size(), 7u);  // Poses 1 to 3 are gone.
  ASSERT_EQ(band.dts.size(), 6u);
  EXPECT_EQ(band.poses[0], (base::Pose2{{0.32, 0.02}, 0.1}));
  EXPECT_NEAR(band.poses[1].p.x, 0.4, 1e-12);
  EXPECT_EQ(band.poses.back(), (base::Pose2{{1.0, 0.1}, 0.2}));
}

}  // namespace
}  // namespace slalom::planners
