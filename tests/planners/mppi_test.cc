#include "planners/mppi.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/error.h"

namespace slalom::planners {
namespace {

/// A unicycle that does at once what is commanded, in a world known from the start.
class World {
 public:
  World(base::Pose2 X_OR, base::Vec2 goal_O) : X_OR_(X_OR), goal_O_(goal_O) {
    path_.push_back(X_OR.p);
    LeadTo(goal_O);
  }

  /// Appends a straight stretch to the path.
  void LeadTo(base::Vec2 p_O) {
    const base::Vec2 from = path_.back();
    for (int i = 1; i <= 100; ++i) path_.push_back(from + (i / 100.0) * (p_O - from));
  }

  /// Leads the path to the goal by way of p_O.
  void LeadBy(base::Vec2 p_O) {
    path_.resize(1);
    LeadTo(p_O);
    LeadTo(goal_O_);
  }

  void AddDisc(base::Vec2 centre, double radius) {
    for (int y = 0; y < costmap_.size_y(); ++y) {
      for (int x = 0; x < costmap_.size_x(); ++x) {
        if (base::Norm(costmap_.CentreOf({x, y}) - centre) < radius) {
          costmap_.set_cost({x, y}, kLethalCost);
        }
      }
    }
  }

  LocalView View() const { return {X_OR_, velocity_, costmap_, path_, false, goal_O_}; }

  /// False: the planner found no command.
  bool Step(MppiPlanner& planner) {
    const auto command = planner.ComputeCommand(View());
    if (!command) return false;
    velocity_ = *command;
    const double middle = X_OR_.yaw + 0.5 * command->angular * 0.05;
    X_OR_.p.x += command->linear * 0.05 * std::cos(middle);
    X_OR_.p.y += command->linear * 0.05 * std::sin(middle);
    X_OR_.yaw += command->angular * 0.05;
    while (path_.size() > 1 && base::Norm(path_[1] - X_OR_.p) < base::Norm(path_[0] - X_OR_.p)) {
      path_.erase(path_.begin());
    }
    return true;
  }

  double goal_distance() const { return base::Norm(goal_O_ - X_OR_.p); }
  const base::Pose2& pose() const { return X_OR_; }
  const Costmap& costmap() const { return costmap_; }
  Twist velocity() const { return velocity_; }

 private:
  base::Pose2 X_OR_;
  base::Vec2 goal_O_;
  Twist velocity_;
  Costmap costmap_{240, 240, 0.05, {-6.0, -6.0}};
  std::vector<base::Vec2> path_;
};

TEST(Mppi, DrivesStraightToTheGoalWhereNothingIsInTheWay) {
  MppiPlanner planner(MppiConfig{});
  planner.Reset(1);
  World world({{-3.0, 0.0}, 0.0}, {3.0, 0.0});
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
  World world({{0.0, 0.0}, 3.0}, {4.0, 0.0});
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
  const MppiConfig config;
  const DiscOutline outline(config.outline_length, config.outline_width);
  for (const std::uint64_t seed : {1, 2, 3}) {
    planner.Reset(seed);
    World world({{-3.0, 0.0}, 0.0}, {3.0, 0.0});
    world.AddDisc({0.0, 0.05}, 0.2);
    world.LeadBy({0.0, -0.5});
    ClearanceMap clearance(0.8);
    clearance.Update(world.costmap(), {0.0, 0.0});
    int steps = 0;
    while (world.goal_distance() > 0.4 && steps < 600) {
      ASSERT_TRUE(world.Step(planner));
      const base::Pose2& pose = world.pose();
      EXPECT_GT(outline.Clearance(
                    clearance, static_cast<float>(pose.p.x), static_cast<float>(pose.p.y),
                    static_cast<float>(std::cos(pose.yaw)), static_cast<float>(std::sin(pose.yaw))),
                0.0f);
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
  World world({{0.0, 0.0}, 0.0}, {4.0, 0.0});
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
  World world({{0.0, 0.0}, 2.0}, {4.0, 1.0});
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(world.Step(planner));
    EXPECT_LE(world.velocity().linear, 0.3 + 1e-6);
    EXPECT_LE(std::abs(world.velocity().angular), 0.5 + 1e-6);
  }
}

TEST(Mppi, IsAFunctionOfSeedAndViews) {
  MppiPlanner one{MppiConfig{}}, other{MppiConfig{}};
  one.Reset(7);
  World first({{-3.0, 0.5}, 0.3}, {3.0, 0.0});
  World second = first;
  for (int i = 0; i < 20; ++i) first.Step(one);
  other.Reset(8);
  for (int i = 0; i < 3; ++i) second.Step(other);
  EXPECT_FALSE(second.velocity() == first.velocity());
  other.Reset(7);
  second = World({{-3.0, 0.5}, 0.3}, {3.0, 0.0});
  for (int i = 0; i < 20; ++i) second.Step(other);
  EXPECT_EQ(second.pose(), first.pose());
}

TEST(Mppi, RefusesStepsThatTurnTooFar) {
  MppiConfig config;
  config.model_dt = 0.5;
  EXPECT_THROW(MppiPlanner{config}, base::Error);
}

}  // namespace
}  // namespace slalom::planners
