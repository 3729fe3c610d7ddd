#include "planners/teb/teb.h"

#include <gtest/gtest.h>

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

/// The side of the disc on which the band passes that the planner follows; 0: it has no command.
double SideFollowed(TebPlanner& planner, const FlatWorld& world) {
  if (!planner.ComputeCommand(world.View())) return 0.0;
  const std::vector<TimedBand> bands = planner.bands();
  for (const base::Pose2& pose : bands.front().poses) {
    if (pose.p.x > 0.0) return pose.p.y > 0.0 ? 1.0 : -1.0;
  }
  return 0.0;
}

TEST(Teb, GoesRoundWhereThePlanLeadsAndIsSlowerToChangeByItsHysteresis) {
  for (const double hysteresis : {1.0, 1e-4}) {
    TebConfig config;
    config.homotopy.prefer_initial_plan = 0.01;
    config.homotopy.cost_hysteresis = hysteresis;
    TebPlanner planner(config);
    for (int i = 0; i < 10; ++i) EXPECT_EQ(SideFollowed(planner, AtADisc(1.0)), 1.0) << i;
    for (int i = 0; i < 10; ++i) {
      EXPECT_EQ(SideFollowed(planner, AtADisc(-1.0)), hysteresis == 1.0 ? -1.0 : 1.0) << i;
    }
  }
}

TEST(Teb, IsFreeToChooseOnceTheBandThatItFollowedIsGone) {
  TebConfig config;
  config.homotopy.cost_hysteresis = 0.01;
  config.trajectory.shrink_horizon = false;
  TebPlanner planner(config);
  EXPECT_EQ(SideFollowed(planner, AtADisc(1.0, -0.1)), 1.0);
  EXPECT_EQ(SideFollowed(planner, AtADisc(1.0, 0.1)), 1.0);
  EXPECT_EQ(SideFollowed(planner, AtAWall()), 0.0);
  EXPECT_TRUE(planner.bands().empty());
  EXPECT_EQ(SideFollowed(planner, AtADisc(1.0, 0.1)), -1.0);
  // A post on the band that it follows, far behind the disc.
  config.homotopy.prefer_initial_plan = 0.1;
  TebPlanner other(config);
  FlatWorld world = AtADisc(1.0, -0.1);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(SideFollowed(other, world), 1.0);
  EXPECT_GT(other.bands().size(), 1u);
  const std::vector<base::Pose2> poses = other.bands().front().poses;
  world.AddDisc(poses[3 * poses.size() / 4].p, 0.05);
  EXPECT_EQ(SideFollowed(other, world), 1.0);
}

// Posts that stand between the first two poses, and a corridor whose walls the robot touches.
TEST(Teb, ChecksTheWayToTheFirstPoseAndLetsARobotOutThatTouchesSomething) {
  TebConfig config;
  config.robot = {.max_linear = 1.5, .max_acceleration = 100.0, .outline_length = 0.2};
  config.homotopy.enabled = false;
  for (const bool has_posts : {false, true}) {
    TebPlanner planner(config);
    FlatWorld world({{-1.5, 0.0}, 0.0}, {1.5, 0.0});
    for (const double y : {-0.2, 0.2}) {
      if (has_posts) world.AddDisc({-1.3, y}, 0.04);
    }
    EXPECT_EQ(world.Step(planner), !has_posts);
  }
  TebPlanner planner{TebConfig{}};
  FlatWorld corridor({{-1.5, 0.0}, 0.0}, {1.5, 0.0});
  for (double x = -2.5; x < 2.5; x += 0.05) {
    for (const double y : {-0.3, 0.3}) corridor.AddDisc({x, y}, 0.11);
  }
  EXPECT_LT(corridor.Clearance(), 0.0);
  EXPECT_TRUE(corridor.Step(planner));
}

TEST(Teb, ChangesSidesNoMoreOftenThanItMay) {
  TebConfig config;
  config.homotopy.prefer_initial_plan = 0.0;
  config.homotopy.switching_blocking_period = 0.475;  // Between the ninth cycle and the tenth.
  TebPlanner planner(config);
  double plan = 1.0;
  for (int i = 0; i < 20; ++i) EXPECT_EQ(SideFollowed(planner, AtADisc(plan)), plan);
  plan = -plan;
  EXPECT_EQ(SideFollowed(planner, AtADisc(plan)), plan) << "the first change is long ago";
  for (int change = 0; change < 2; ++change) {
    plan = -plan;
    for (int i = 1; i < 10; ++i) EXPECT_EQ(SideFollowed(planner, AtADisc(plan)), -plan) << i;
    EXPECT_EQ(SideFollowed(planner, AtADisc(plan)), plan);
  }
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

// Whatever the episode before ended in: a change of sides, failures, or bands that are still good.
TEST(Teb, BeginsAnEpisodeAsAFreshPlanner) {
  const FlatWorld left = AtADisc(1.0, -0.1), right = AtADisc(-1.0, 0.1), wall = AtAWall();
  const FlatWorld detour = AtADisc(1.0, 0.1);  // The plan leads along the longer way.
  for (const double hysteresis : {1.0, 0.01}) {
    TebConfig config;
    config.homotopy.cost_hysteresis = hysteresis;
    config.homotopy.switching_blocking_period = 100.0;
    for (const FlatWorld* last : {&left, &right, &wall}) {
      for (const FlatWorld* first : {&left, &detour, &wall}) {
        TebPlanner used(config), fresh(config);
        used.Reset(5);
        for (int i = 0; i < 3; ++i) std::ignore = used.ComputeCommand(left.View());
        for (int i = 0; i < 12; ++i) std::ignore = used.ComputeCommand(last->View());
        used.Reset(6);
        fresh.Reset(6);
        for (const FlatWorld* world : {first, first, first, &left, &right}) {
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
}

// Towards a bend, so that the headings of the robot, of its bands and of their ends pass the cut of
// angles where they are turned by half a turn.
TEST(Teb, DrivesTheSameWhicheverWayItHeads) {
  TebConfig config;
  config.trajectory.look_ahead = 1.5;
  config.trajectory.reinit_angle = 0.5;
  for (const double heading : {-0.2, 0.2}) {
    std::vector<Twist> commands;
    for (const double yaw : {0.0, base::kPi / 2, base::kPi, -base::kPi / 2}) {
      const base::Pose2 X_OC{{}, yaw};
      TebPlanner planner(config);
      FlatWorld world({base::Transform(X_OC, {-2.0, 0.0}), base::WrapAngle(yaw + heading)},
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
}

}  // namespace
}  // namespace slalom::planners
