#include "planners/mppi/mppi.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "tests/planners/flat_world.h"

namespace slalom::planners {
namespace {

TEST(Mppi, DrivesStraightToTheGoalWhereNothingIsInTheWay) {
  MppiPlanner planner(MppiConfig{});
  planner.Reset(1);
  FlatWorld world({{-3.0, 0.0}, 0.0}, {3.0, 0.0});
  int steps = 0;
  double fastest = 0.0;
  while (world.goal_distance() > 0.4 && steps < 400) {
    ASSERT_TRUE(world.Step(planner));
    EXPECT_LT(std::abs(world.pose().p.y), 0.15);
    fastest = std::max(fastest, world.velocity().linear);
    ++steps;
  }
  EXPECT_LT(steps, 400);
  EXPECT_GT(fastest, 0.4);
}

TEST(Mppi, TurnsRoundWhenTheGoalIsBehind) {
  MppiPlanner planner(MppiConfig{});
  planner.Reset(2);
  FlatWorld world({{0.0, 0.0}, 3.0}, {4.0, 0.0});
  int steps = 0;
  while (world.goal_distance() > 0.4 && steps < 500) {
    ASSERT_TRUE(world.Step(planner));
    ++steps;
  }
  EXPECT_LT(steps, 500);
  EXPECT_GT(std::cos(world.pose().yaw), 0.7);
}

TEST(Mppi, FollowsThePathRoundAnObstacleWithoutTouching) {
  MppiPlanner planner(MppiConfig{});
  for (const std::uint64_t seed : {1, 2, 3}) {
    planner.Reset(seed);
    FlatWorld world({{-3.0, 0.0}, 0.0}, {3.0, 0.0});
    world.AddDisc({0.0, 0.05}, 0.2);
    world.LeadBy({0.0, -0.5});
    int steps = 0;
    while (world.goal_distance() > 0.4 && steps < 600) {
      ASSERT_TRUE(world.Step(planner));
      EXPECT_GT(world.Clearance(), 0.0);
      ++steps;
    }
    EXPECT_LT(steps, 600) << "seed " << seed;
  }
}

TEST(Mppi, HasNoCommandWhereEverythingCollides) {
  MppiConfig config;
  config.max_acceleration = 0.1;  // So that it cannot stop.
  MppiPlanner planner(config);
  planner.Reset(3);
  FlatWorld world({{0.0, 0.0}, 0.0}, {4.0, 0.0});
  world.AddDisc({1.3, 0.0}, 1.0);
  const LocalView still = world.View();
  const LocalView fast{still.X_OR, {2.0, 0.0}, still.costmap, still.path_O, false, still.goal_O};
  EXPECT_FALSE(planner.ComputeCommand(fast).has_value());
}

TEST(Mppi, KeepsItsSpeedLimits) {
  MppiConfig config;
  config.max_linear = 0.3;
  config.max_angular = 0.5;
  MppiPlanner planner(config);
  planner.Reset(4);
  FlatWorld world({{0.0, 0.0}, 2.0}, {4.0, 1.0});
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(world.Step(planner));
    EXPECT_LE(world.velocity().linear, 0.3 + 1e-6);
    EXPECT_LE(std::abs(world.velocity().angular), 0.5 + 1e-6);
  }
}

TEST(Mppi, RefusesStepsThatTurnTooFar) {
  MppiConfig config;
  config.model_dt = 0.5;
  EXPECT_THROW(MppiPlanner{config}, base::Error);
}

}  // namespace
}  // namespace slalom::planners
