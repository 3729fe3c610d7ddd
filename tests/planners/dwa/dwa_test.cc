#include "planners/dwa/dwa.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/random.h"
#include "planners/navigation/inflation.h"
#include "tests/planners/random_maps.h"

namespace slalom::planners {
namespace {

const PaddedFootprint kFootprint{FootprintConfig{}};

/// An inflated 10 x 10 m map round the origin of O, with the obstacles given.
Costmap LocalMap(const std::vector<base::Vec2>& obstacles_O) {
  Costmap map(200, 200, 0.05, {-5.0, -5.0});
  std::vector<std::uint8_t> cells(map.costs().size(), kFreeCost);
  for (const base::Vec2 p_O : obstacles_O) cells[map.Index(map.CellAt(p_O))] = kLethalCost;
  Inflation(0.05, 0.265, 0.3, 10.0).Apply(cells, {0, 0, 200, 200}, map);
  return map;
}

std::vector<base::Vec2> StraightPath(base::Vec2 from_O, base::Vec2 to_O) {
  std::vector<base::Vec2> path;
  const int steps = static_cast<int>(base::Norm(to_O - from_O) / 0.025);
  for (int i = 0; i <= steps; ++i) {
    path.push_back(from_O + (static_cast<double>(i) / steps) * (to_O - from_O));
  }
  return path;
}

/// A row of obstacles from a to b without gaps.
void AddWall(base::Vec2 a, base::Vec2 b, std::vector<base::Vec2>& obstacles_O) {
  for (const base::Vec2 p : StraightPath(a, b)) obstacles_O.push_back(p);
}

struct Scene {
  Costmap map;
  std::vector<base::Vec2> path_O;
  base::Pose2 X_OR;
  Twist velocity;

  LocalView view() const {
    return {.X_OR = X_OR,
            .velocity = velocity,
            .costmap = map,
            .path_O = path_O,
            .path_is_new = true,
            .goal_O = path_O.back()};
  }
};

TEST(Dwa, CountsTheHighestCostUnderTheOutline) {
  // The outline's upper edge, y = 0.265, runs 0.26 to 0.28 m below this obstacle's cell.
  const Scene scene{
      LocalMap({{0.52, 0.57}}), StraightPath({0.0, 0.0}, {8.0, 0.0}), {{0.02, 0.02}, 0.0}, {}};
  DwaPlanner planner({}, {});
  planner.Reset(0);
  ASSERT_TRUE(planner.ComputeCommand(scene.view()));
  const auto ahead = planner.Score(scene.view(), {0.5, 0.0});
  // y = 0.02 + 0.265 = 0.285 is in row 105; the obstacle is in row 111: six rows.
  EXPECT_NEAR(ahead.cost, 0.05 * 80 + 0.1 * 177, 1e-12);
  DwaConfig config;
  config.meter_scoring = false;
  DwaPlanner in_cells(config, {});
  in_cells.Reset(0);
  ASSERT_TRUE(in_cells.ComputeCommand(scene.view()));
  EXPECT_NEAR(in_cells.Score(scene.view(), {0.5, 0.0}).cost, 80 + 0.1 * 177, 1e-12);
}

TEST(Dwa, BacksUpWhereNothingElseIsAdmissible) {
  // Something close ahead, behind, and where each front corner would turn to.
  const std::vector<base::Vec2> obstacles = {
      {0.37, 0.0}, {-0.42, 0.0}, {0.24, 0.32}, {0.24, -0.32}};
  Scene scene{LocalMap(obstacles), StraightPath({0.0, 0.0}, {4.0, 0.0}), {}, {}};
  DwaPlanner planner({}, {});
  planner.Reset(0);
  EXPECT_EQ(planner.ComputeCommand(scene.view()), (Twist{-0.5, 0.0}));
  // Once it could go ahead it still does not, until it has moved by 0.1 m.
  scene.map = LocalMap({});
  scene.X_OR.p.x = -0.05;
  auto command = planner.ComputeCommand(scene.view());
  ASSERT_TRUE(command);
  EXPECT_EQ(command->linear, 0.0) << "escaping: turns only";
  scene.X_OR.p.x = -0.15;
  ASSERT_TRUE(planner.ComputeCommand(scene.view()));  // The escape ends here.
  command = planner.ComputeCommand(scene.view());
  ASSERT_TRUE(command);
  EXPECT_GT(command->linear, 0.0);
  // The next escape is measured from where it began.
  std::vector<base::Vec2> moved;
  for (const base::Vec2 p : obstacles) moved.push_back(p + base::Vec2{1.0, 0.0});
  scene.map = LocalMap(moved);
  scene.X_OR.p.x = 1.0;
  EXPECT_EQ(planner.ComputeCommand(scene.view()), (Twist{-0.5, 0.0}));
  scene.map = LocalMap({});
  scene.X_OR.p.x = 0.95;
  for (int cycle = 0; cycle < 2; ++cycle) {
    command = planner.ComputeCommand(scene.view());
    ASSERT_TRUE(command);
    EXPECT_EQ(command->linear, 0.0) << "escaping again";
  }
  planner.Reset(0);
  command = planner.ComputeCommand(scene.view());
  ASSERT_TRUE(command);
  EXPECT_GT(command->linear, 0.0) << "an escape ends with its episode";
}

TEST(Dwa, EscapesOnWhereTheHeadingPassesHalfATurn) {
  const std::vector<base::Vec2> obstacles = {
      {-0.37, 0.0}, {0.42, 0.0}, {-0.24, 0.32}, {-0.24, -0.32}};
  Scene scene{
      LocalMap(obstacles), StraightPath({0.0, 0.0}, {-4.0, 0.0}), {{}, base::kPi - 0.01}, {}};
  DwaPlanner planner({}, {});
  planner.Reset(0);
  EXPECT_EQ(planner.ComputeCommand(scene.view()), (Twist{-0.5, 0.0}));
  scene.map = LocalMap({});
  scene.X_OR.yaw = -base::kPi + 0.01;
  for (int cycle = 0; cycle < 2; ++cycle) {
    const auto command = planner.ComputeCommand(scene.view());
    ASSERT_TRUE(command);
    EXPECT_EQ(command->linear, 0.0) << "escaping: turns only";
  }
}

TEST(Dwa, HasNoCommandWithoutAWayToTheGoal) {
  std::vector<base::Vec2> obstacles;
  AddWall({2.0, -5.0}, {2.0, 4.99}, obstacles);
  const Scene scene{LocalMap(obstacles), StraightPath({0.0, 0.0}, {4.0, 0.0}), {}, {}};
  DwaPlanner planner({}, {});
  planner.Reset(0);
  EXPECT_EQ(planner.ComputeCommand(scene.view()), std::nullopt);
  Scene off_path = scene;
  off_path.path_O = StraightPath({7.0, 7.0}, {8.0, 8.0});
  EXPECT_EQ(planner.ComputeCommand(off_path.view()), std::nullopt) << "no path on the map";
}

// Its middle is in an inflated cell, which only the distances to the path overlook.
TEST(Dwa, HasNoCommandInAnInflatedCell) {
  Scene scene{LocalMap({}), StraightPath({0.0, 0.0}, {4.0, 0.0}), {{0.02, 0.02}, 0.0}, {}};
  DwaPlanner planner({}, {});
  planner.Reset(0);
  Fill(scene.map, {101, 98, 102, 103}, kInscribedCost);  // Under the robot, across the path.
  ASSERT_TRUE(planner.ComputeCommand(scene.view()));
  // The goal, 80 cells ahead, is round the wall of 5 cells: 3 steps up and 3 down. The path is
  // here.
  const double on_the_spot = planner.Score(scene.view(), {0.0, 0.4}).cost;
  EXPECT_NEAR(on_the_spot, 0.05 * (80 + 2 * 3), 1e-12);
  scene.map.set_cost({100, 100}, kInscribedCost);
  EXPECT_EQ(planner.ComputeCommand(scene.view()), std::nullopt);
}

TEST(Dwa, DoesNotTurnThereAndBack) {
  // The path leads back; on the spot, the robot may try both sides, but having turned to one of
  // them twice it may not turn to the other.
  Scene scene{LocalMap({}), StraightPath({0.0, 0.0}, {-4.0, 0.4}), {}, {}};
  DwaConfig config;
  config.min_speed = config.max_speed = 0.1;
  DwaPlanner planner(config, {});
  planner.Reset(0);
  const auto command = [&](base::Vec2 to) {
    scene.path_O = StraightPath(scene.X_OR.p, to);
    return planner.ComputeCommand(scene.view()).value();
  };
  const base::Vec2 left{-4.0, 0.4}, right{-4.0, -0.4};
  for (const double x : {0.0, 0.1, 0.2}) {
    scene.X_OR.p.x = x;
    EXPECT_GT(command({4.0, 0.0}).linear, 0.0) << "drives, and forgets its turns elsewhere";
    EXPECT_EQ(command(left).linear, 0.0);
    EXPECT_LT(command(right).angular, 0.0) << "once";
    EXPECT_GT(command(left).angular, 0.0) << "twice";
    EXPECT_GE(command(right).angular, 0.0) << "right was given up";
  }
  planner.Reset(0);
  EXPECT_LT(command(right).angular, 0.0) << "in an episode that is over";
}

/// The algorithm without its short cuts: all samples in ROS's order, outlines laid for each.
std::optional<Twist> SlowCommand(const DwaConfig& config, const Scene& scene) {
  const Costmap& map = scene.map;
  std::vector<CellIndex> under_robot, targets;
  CoveredCells(map, kFootprint, scene.X_OR, under_robot);
  base::Vec2 end_O;
  for (const base::Vec2 p : scene.path_O) {
    if (!map.Contains(map.CellAt(p))) break;
    targets.push_back(map.CellAt(p));
    end_O = p;
    if (base::Norm(p - scene.X_OR.p) > 5.0) break;
  }
  DistanceGrid to_path, to_goal;
  to_path.Start(map, under_robot, targets);
  to_goal.Start(map, {}, std::span(targets).last(1));

  base::Pose2 end;
  const auto score = [&](Twist command) {
    const int num = std::max(
        1, static_cast<int>(std::max(std::fabs(command.linear) * 2.0 / config.sim_granularity,
                                     std::fabs(command.angular) / 0.02) +
                            0.5));
    const double dt = 2.0 / num;
    base::Pose2 X = scene.X_OR;
    Twist v = scene.velocity;
    int highest = 0;
    double cost = 0.0;
    for (int i = 0; i < num; ++i) {
      end = X;
      const CellIndex c = map.CellAt(X.p);
      const int outline = OutlineCost(map, kFootprint, X);
      if (outline < 0) return -1.0;
      if (to_path.Distance(c) == DistanceGrid::kNoWay) return -2.0;
      if (to_goal.Distance(c) == DistanceGrid::kNoWay) return -2.0;
      highest = std::max<int>({highest, outline, map.cost(c)});
      cost = 0.05 * (0.75 * to_path.Distance(c) + 1.0 * to_goal.Distance(c));
      v.linear += std::clamp(command.linear - v.linear, -10.0 * dt, 10.0 * dt);
      v.angular += std::clamp(command.angular - v.angular, -20.0 * dt, 20.0 * dt);
      X.p = X.p + (v.linear * dt) * base::Vec2{std::cos(X.yaw), std::sin(X.yaw)};
      X.yaw += v.angular * dt;
    }
    return cost + 0.1 * highest;
  };

  const double v = scene.velocity.linear, w = scene.velocity.angular;
  const double top = std::min(0.5, base::Norm(end_O - scene.X_OR.p) / 2.0);
  const double v_max = std::max(std::min(top, v + 0.5), 0.1), v_min = std::max(0.1, v - 0.5);
  const double w_max = std::min(1.57, w + 1.0), w_min = std::max(-1.57, w - 1.0);
  const double dv = (v_max - v_min) / 5, dw = (w_max - w_min) / 19;
  double best_cost = -1.0;
  Twist best;
  for (int i = 0; i < 6; ++i) {
    for (int j = -1; j < 19; ++j) {
      const Twist command{v_min + i * dv, j < 0 ? 0.0 : w_min + j * dw};
      const double cost = score(command);
      if (cost >= 0.0 && (best_cost < 0.0 || cost < best_cost)) {
        best_cost = cost;
        best = command;
      }
    }
  }
  double nearest = std::numeric_limits<double>::max();
  for (int i = 0; i < 20; ++i) {
    const double sample = w_min + i * dw;
    const double rate = sample > 0.0 ? std::max(sample, 0.314) : std::min(sample, -0.314);
    const double cost = score({0.0, rate});
    if (cost < 0.0 || (best_cost >= 0.0 && cost > best_cost)) continue;
    if (!(sample > dw || sample < -dw)) continue;
    const CellIndex c =
        map.CellAt(end.p + 0.325 * base::Vec2{std::cos(end.yaw), std::sin(end.yaw)});
    if (!map.Contains(c) || to_goal.Distance(c) >= nearest) continue;
    nearest = to_goal.Distance(c);
    best_cost = cost;
    best = {0.0, rate};
  }
  if (best_cost >= 0.0) return best;
  const double back = score({-0.5, 0.0});
  if (back == -2.0) return std::nullopt;
  return Twist{-0.5, 0.0};
}

TEST(Dwa, AgreesWithTheSlowAlgorithm) {
  base::Random random(10);
  int num_ahead = 0, num_turns = 0, num_backwards = 0;
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<base::Vec2> obstacles;
    const int num = 20 + static_cast<int>(random.UniformInt(120));
    while (static_cast<int>(obstacles.size()) < num) {
      const base::Vec2 p{random.Uniform(-2.0, 2.0), random.Uniform(-2.0, 2.0)};
      if (std::fabs(p.x) > 0.4 || std::fabs(p.y) > 0.35) obstacles.push_back(p);
    }
    const double direction = random.Uniform(-3.0, 3.0);
    const base::Vec2 end{6.0 * std::cos(direction), 6.0 * std::sin(direction)};
    const Scene scene{
        LocalMap(obstacles),
        StraightPath({0.0, 0.0}, end),
        {{random.Uniform(-0.05, 0.05), random.Uniform(-0.05, 0.05)}, random.Uniform(-0.1, 0.1)},
        {random.Uniform(-0.5, 0.5), random.Uniform(-1.5, 1.5)}};
    DwaPlanner planner({}, {});
    planner.Reset(0);
    const auto command = planner.ComputeCommand(scene.view());
    const auto expected = SlowCommand({}, scene);
    ASSERT_EQ(command.has_value(), expected.has_value()) << trial;
    if (!command) continue;
    EXPECT_NEAR(command->linear, expected->linear, 1e-9) << trial;
    EXPECT_NEAR(command->angular, expected->angular, 1e-9) << trial;
    num_ahead += command->linear > 0.0;
    num_turns += command->linear == 0.0;
    num_backwards += command->linear < 0.0;
  }
  EXPECT_GT(num_ahead, 20);
  EXPECT_GT(num_turns, 20);
  EXPECT_GT(num_backwards, 1);
}

}  // namespace
}  // namespace slalom::planners
