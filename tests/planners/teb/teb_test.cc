#include "planners/teb/teb.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/planners/flat_world.h"

namespace slalom::planners {
namespace {

TEST(Teb, DrivesStraightToTheGoalWhereNothingIsInTheWay) {
  TebPlanner planner{TebConfig{}};
  planner.Reset(1);
  FlatWorld world({{-2.0, 0.0}, 0.0}, {2.0, 0.0});
  int steps = 0;
  while (world.goal_distance() > 0.2 && steps < 400) {
    ASSERT_TRUE(world.Step(planner));
    EXPECT_NEAR(world.pose().p.y, 0.0, 1e-3);
    EXPECT_LE(world.velocity().linear, 0.6);
    ++steps;
  }
  // 3.8 m at 0.45 m/s and a second for the ramps.
  EXPECT_LT(steps, 190);
}

TEST(Teb, PassesAnObstacleInTheWay) {
  TebPlanner planner{TebConfig{}};
  for (const std::uint64_t seed : {1, 2}) {
    planner.Reset(seed);
    FlatWorld world({{-2.0, 0.0}, 0.0}, {2.0, 0.0});
    world.AddDisc({0.0, 0.05}, 0.2);
    int steps = 0;
    while (world.goal_distance() > 0.2 && steps < 500) {
      ASSERT_TRUE(world.Step(planner)) << steps;
      EXPECT_GT(world.Clearance(), 0.0) << steps;
      ++steps;
    }
    EXPECT_LT(steps, 500) << "seed " << seed;
  }
}

TEST(Teb, KnowsBothWaysRoundAnObstacle) {
  TebConfig config;
  TebPlanner planner(config);
  planner.Reset(3);
  FlatWorld world({{-1.5, 0.0}, 0.0}, {1.5, 0.0});
  world.LeadBy({0.0, 0.6});
  world.AddDisc({0.0, 0.0}, 0.25);
  for (int i = 0; i < 10; ++i) static_cast<void>(planner.ComputeCommand(world.View()));
  bool left = false, right = false;
  for (const TimedBand& band : planner.bands()) {
    const base::Pose2& middle = band.poses[band.poses.size() / 2];
    left |= middle.p.y > 0.25;
    right |= middle.p.y < -0.25;
  }
  EXPECT_TRUE(left && right);
  EXPECT_LE(planner.bands().size(), 4u);

  config.homotopy.enabled = false;
  TebPlanner single(config);
  for (int i = 0; i < 10; ++i) static_cast<void>(single.ComputeCommand(world.View()));
  EXPECT_EQ(single.bands().size(), 1u);
}

TEST(Teb, HasNoCommandWhereTheBandCollides) {
  TebPlanner planner{TebConfig{}};
  planner.Reset(4);
  FlatWorld world({{0.0, 0.0}, 0.0}, {4.0, 0.0});
  for (double y = -5.0; y < 5.0; y += 0.1) world.AddDisc({0.45, y}, 0.1);
  int num_commands = 0;
  for (int i = 0; i < 100; ++i) {
    num_commands += world.Step(planner);
    EXPECT_GT(world.Clearance(), 0.0);
  }
  EXPECT_LT(num_commands, 100);
}

// The corridor is too narrow for a robot that lies across it. Quarters of a turn leave the cells of
// the map where they are.
TEST(Teb, GoesAlongANarrowCorridorWhicheverWayItLies) {
  for (const double yaw : {0.0, base::kPi / 2, base::kPi, -base::kPi / 2}) {
    for (const double heading : {-0.05, 0.05}) {
      const base::Pose2 X_OC{{}, yaw};
      TebConfig config;
      config.robot.max_linear = 1.5;  // Poses are farther apart than the robot is wide.
      TebPlanner planner{config};
      planner.Reset(7);
      FlatWorld world({base::Transform(X_OC, {-2.0, 0.0}), base::WrapAngle(yaw + heading)},
                      base::Transform(X_OC, {2.0, 0.0}));
      for (double x = -2.5; x < 2.5; x += 0.05) {
        for (const double y : {-0.4, 0.4}) world.AddDisc(base::Transform(X_OC, {x, y}), 0.11);
      }
      for (int i = 0; i < 40; ++i) {
        ASSERT_TRUE(world.Step(planner)) << yaw << " " << heading << ", step " << i;
      }
      EXPECT_LT(world.goal_distance(), 3.0) << yaw;
    }
  }
}

TEST(Teb, IsAFunctionOfSeedAndViews) {
  TebPlanner one{TebConfig{}}, other{TebConfig{}};
  one.Reset(5);
  FlatWorld first({{-2.0, 0.0}, 0.3}, {2.0, 0.0});
  first.AddDisc({0.0, 0.05}, 0.2);
  FlatWorld second = first;
  other.Reset(6);
  for (int i = 0; i < 20; ++i) {
    first.Step(one);
    FlatWorld copy = second;
    copy.Step(other);
  }
  // Without a command for long.
  FlatWorld blocked({{0.0, 0.0}, 0.0}, {4.0, 0.0});
  for (double y = -5.0; y < 5.0; y += 0.1) blocked.AddDisc({0.45, y}, 0.1);
  for (int i = 0; i < 12; ++i) blocked.Step(other);
  other.Reset(5);
  for (int i = 0; i < 20; ++i) second.Step(other);
  EXPECT_EQ(second.pose(), first.pose());
}

}  // namespace
}  // namespace slalom::planners
