#include "planners/teb/teb.h"

#include <gtest/gtest.h>

#include <cmath>
#include <tuple>
#include <vector>

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

/// A disc between the robot and its goal, on whose left (1) or right (-1) side the plan leads.
FlatWorld AtADisc(double side, double centre_y = 0.0) {
  FlatWorld world({{-1.5, 0.0}, 0.0}, {1.5, 0.0});
  world.LeadBy({0.0, 0.6 * side});
  world.AddDisc({0.0, centre_y}, 0.25);
  return world;
}

/// A wall before the robot, with the same goal.
FlatWorld AtAWall() {
  FlatWorld world({{-1.5, 0.0}, 0.0}, {1.5, 0.0});
  for (double y = -5.0; y < 5.0; y += 0.1) world.AddDisc({-1.0, y}, 0.2);
  return world;
}

TEST(Teb, HalvesItsHorizonForAWhileAndQuartersItAfterManyFailures) {
  TebConfig config;
  config.trajectory.look_ahead = 2.0;
  config.trajectory.shrink_horizon_duration = 0.475;
  TebPlanner planner(config);
  const FlatWorld open({{-1.5, 0.0}, 0.0}, {1.5, 0.0});
  const auto horizon = [&] {
    EXPECT_TRUE(planner.ComputeCommand(open.View()));
    return planner.bands().front().poses.back().p.x + 1.5;
  };
  EXPECT_NEAR(horizon(), 2.0, 0.06);
  for (const int failures : {9, 9, 10, 1}) {
    for (int i = 0; i < failures; ++i) EXPECT_FALSE(planner.ComputeCommand(AtAWall().View()));
    EXPECT_NEAR(horizon(), failures < 10 ? 1.0 : 0.5, 0.06) << failures;
    for (int i = 2; i < 10; ++i) EXPECT_NEAR(horizon(), 1.0, 0.06) << i;
    EXPECT_NEAR(horizon(), 2.0, 0.06) << failures;
  }
}

// Whatever the episode before ended in: failures, or bands that are still good.
TEST(Teb, BeginsAnEpisodeAsAFreshPlanner) {
  TebConfig config;
  config.homotopy.cost_hysteresis = 0.1;
  config.homotopy.switching_blocking_period = 100.0;
  config.homotopy.prefer_initial_plan = 0.3;
  const std::vector<FlatWorld> before = {AtADisc(1.0), AtADisc(-1.0), AtAWall()};
  const std::vector<FlatWorld> openings = {AtADisc(1.0, 0.1), AtADisc(-1.0, -0.1), AtAWall()};
  for (const FlatWorld& last : before) {
    for (const FlatWorld& first : openings) {
      TebPlanner used(config), fresh(config);
      used.Reset(5);
      for (int i = 0; i < 3; ++i) std::ignore = used.ComputeCommand(before[0].View());
      for (int i = 0; i < 12; ++i) std::ignore = used.ComputeCommand(last.View());
      used.Reset(6);
      fresh.Reset(6);
      for (const FlatWorld* world : {&first, &first, &first, &openings[0], &openings[1]}) {
        ASSERT_EQ(used.ComputeCommand(world->View()), fresh.ComputeCommand(world->View()));
        const auto bands = used.bands(), expected = fresh.bands();
        ASSERT_EQ(bands.size(), expected.size());
        for (std::size_t i = 0; i < bands.size(); ++i) {
          EXPECT_EQ(bands[i].poses, expected[i].poses);
          EXPECT_EQ(bands[i].dts, expected[i].dts);
        }
      }
    }
  }
}

// Towards a bend, so that the headings of the robot, of its bands and of their ends pass the cut of
// angles where they are turned by half a turn.
TEST(Teb, DrivesTheSameWhicheverWayItHeads) {
  TebConfig config;
  config.trajectory.look_ahead = 1.5;
  config.trajectory.reinit_angle = 0.5;
  std::vector<Twist> commands;
  for (const double yaw : {0.0, base::kPi / 2, base::kPi, -base::kPi / 2}) {
    const base::Pose2 X_OC{{}, yaw};
    TebPlanner planner(config);
    FlatWorld world({base::Transform(X_OC, {-2.0, 0.0}), base::WrapAngle(yaw - 0.2)},
                    base::Transform(X_OC, {2.0, 0.3}));
    world.LeadBy(base::Transform(X_OC, {-0.3, -0.1}));
    for (std::size_t i = 0; i < 40; ++i) {
      ASSERT_TRUE(world.Step(planner));
      if (yaw == 0.0) commands.push_back(world.velocity());
      EXPECT_NEAR(world.velocity().linear, commands[i].linear, 1e-6) << yaw << ", step " << i;
      EXPECT_NEAR(world.velocity().angular, commands[i].angular, 1e-6) << yaw << ", step " << i;
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
