#include "planners/teb/band_optimizer.h"

#include <gtest/gtest.h>

#include "base/random.h"
#include "planners/teb/teb_edges.h"

namespace slalom::planners {
namespace {

TimedBand BandAlong(const TebConfig& config, base::Vec2 goal, double goal_yaw) {
  std::vector<base::Vec2> points;
  for (int i = 0; i <= 40; ++i) points.push_back((i / 40.0) * goal);
  return MakeBand(points, 0.0, goal_yaw, config.robot.max_linear, config.robot.max_angular,
                  config.trajectory.min_samples);
}

/// Several cycles' worth, so that it has settled.
void Settle(BandOptimizer& optimizer, const BandSurroundings& surroundings, TimedBand& band) {
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(optimizer.Optimize(surroundings, band));
}

TEST(BandOptimizer, GoesStraightAndAsFastAsAllowedWhereNothingIsInTheWay) {
  const TebConfig config;
  BandOptimizer optimizer(config);
  TimedBand band = BandAlong(config, {3.0, 0.0}, 0.0);
  Settle(optimizer, {}, band);
  for (const base::Pose2& pose : band.poses) {
    EXPECT_NEAR(pose.p.y, 0.0, 1e-6);
    EXPECT_NEAR(pose.yaw, 0.0, 1e-6);
  }
  double fastest = 0.0;
  for (std::size_t i = 0; i < band.dts.size(); ++i) {
    const double v = (band.poses[i + 1].p.x - band.poses[i].p.x) / band.dts[i];
    EXPECT_GT(v, 0.0);
    fastest = std::max(fastest, v);
  }
  // Limits are soft from penalty_epsilon below them on: 0.5 m/s and 0.9 m/s^2. The best run under
  // those, ramps and all, takes 3 / 0.5 + 0.5 / 0.9 s; under twice the speed's margin, less.
  EXPECT_GT(fastest, 0.5);
  EXPECT_LT(fastest, 0.7);
  EXPECT_LT(band.Duration(), 3.0 / 0.5 + 0.5 / 0.9);
  EXPECT_GT(band.Duration(), 3.0 / 0.7 + 0.7 / 1.3);
}

TEST(BandOptimizer, KeepsItsDistanceFromAnObstacle) {
  const TebConfig config;
  BandOptimizer optimizer(config);
  TimedBand band = BandAlong(config, {3.0, 0.0}, 0.0);
  const base::Vec2 obstacles[] = {{1.5, 0.05}};
  Settle(optimizer, {obstacles, {}, {}}, band);
  double nearest = 10.0;
  for (const base::Pose2& pose : band.poses) {
    nearest = std::min(nearest, base::Norm(pose.p - obstacles[0]));
    EXPECT_LT(pose.p.y, 1e-3);  // All of it passes below.
  }
  EXPECT_GT(nearest, 0.25);
  EXPECT_LT(nearest, 0.6);
  for (std::size_t i = 0; i < band.dts.size(); ++i) {
    EXPECT_NEAR(NonholonomicError(band.poses[i], band.poses[i + 1]).value, 0.0, 0.02);
  }
}

TEST(BandOptimizer, EndsInALocalMinimum) {
  // One resizing at the end of which no band near by is cheaper.
  TebConfig config;
  config.optimizer.outer_iterations = 1;
  config.optimizer.inner_iterations = 200;
  config.optimizer.weight_shortest_path = 0.3;
  config.obstacle.cost_exponent = 2.0;
  BandOptimizer optimizer(config);
  TimedBand band = BandAlong(config, {2.0, 0.6}, 0.4);
  const base::Vec2 obstacles[] = {{1.0, 0.15}, {0.6, 0.6}};
  const base::Vec2 via_points[] = {{1.2, 0.1}};
  const BandSurroundings surroundings{obstacles, via_points, {0.2, 0.1}};
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(optimizer.Optimize(surroundings, band));
  const double least = optimizer.Cost(surroundings, band).total();
  base::Random random(1);
  int num_cheaper = 0;
  for (int trial = 0; trial < 500; ++trial) {
    TimedBand other = band;
    for (std::size_t i = 1; i + 1 < other.poses.size(); ++i) {
      other.poses[i].p.x += 1e-3 * random.Normal();
      other.poses[i].p.y += 1e-3 * random.Normal();
      other.poses[i].yaw += 1e-3 * random.Normal();
    }
    for (double& dt : other.dts) dt += 1e-3 * random.Normal();
    num_cheaper += optimizer.Cost(surroundings, other).total() < least;
  }
  EXPECT_EQ(num_cheaper, 0);
}

TEST(BandOptimizer, IsDrawnByViaPoints) {
  TebConfig config;
  config.optimizer.weight_via_point = 10.0;
  BandOptimizer optimizer(config);
  TimedBand band = BandAlong(config, {3.0, 0.0}, 0.0);
  const base::Vec2 via_points[] = {{1.5, 0.4}};
  Settle(optimizer, {{}, via_points, {}}, band);
  double nearest = 10.0;
  for (const base::Pose2& pose : band.poses) {
    nearest = std::min(nearest, base::Norm(pose.p - via_points[0]));
  }
  EXPECT_LT(nearest, 0.2);
}

TEST(BandOptimizer, CountsObstaclesApart) {
  const TebConfig config;
  BandOptimizer optimizer(config);
  TimedBand band;
  band.poses = {{{0.0, 0.0}, 0.0}, {{0.3, 0.0}, 0.0}, {{0.6, 0.0}, 0.0}};
  band.dts = {1.0, 1.0};
  const base::Vec2 obstacles[] = {{0.3, 0.2}};
  const BandCost cost = optimizer.Cost({obstacles, {}, {}}, band);
  // 0.15 m within 0.25 + 0.1, and 0.4 m within 0.6.
  EXPECT_NEAR(cost.obstacles, 100.0 * 0.15 * 0.15 + 0.1 * 0.4 * 0.4, 1e-9);
  // Two times of 1 s; speeds and accelerations are inside their limits.
  EXPECT_NEAR(cost.rest, 2.0, 1e-9);
}

}  // namespace
}  // namespace slalom::planners
