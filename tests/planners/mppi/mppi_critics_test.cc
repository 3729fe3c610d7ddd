#include "planners/mppi/mppi_critics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

namespace slalom::planners {
namespace {

/// A view of hand-made rollouts on a map of 8 x 8 m around the robot.
class CriticsTest : public testing::Test {
 protected:
  void Make(int batch_size, int num_steps) {
    rollouts_ = std::make_unique<Rollouts>(batch_size, num_steps);
    costs_.assign(static_cast<std::size_t>(batch_size), 0.0f);
    collides_.assign(static_cast<std::size_t>(batch_size), 0);
    for (float& c : rollouts_->cosine) c = 1.0f;
    clearance_.Update(costmap_, {0.0, 0.0});
  }

  /// Rollout b goes straight, `step` [m] a step, in the direction of `yaw`.
  void GoStraight(int b, double step, double yaw) {
    for (int t = 0; t < rollouts_->num_steps; ++t) {
      const std::size_t i = rollouts_->Index(t, b);
      rollouts_->linear[i] = static_cast<float>(step / 0.05);
      rollouts_->x[i] = static_cast<float>((t + 1) * step * std::cos(yaw));
      rollouts_->y[i] = static_cast<float>((t + 1) * step * std::sin(yaw));
      rollouts_->cosine[i] = static_cast<float>(std::cos(yaw));
      rollouts_->sine[i] = static_cast<float>(std::sin(yaw));
    }
  }

  /// Along x, every 0.05 m.
  void MakeStraightPath(int num_points) {
    for (int i = 0; i < num_points; ++i) {
      path_.x.push_back(0.05f * static_cast<float>(i));
      path_.y.push_back(0.0f);
    }
    path_.spacing = 0.05f;
    path_.length_to_goal = 10.0f;
  }

  void SetLethal(double x, double y) { costmap_.set_cost(costmap_.CellAt({x, y}), kLethalCost); }

  CriticView View() {
    SurveyPath(*rollouts_, 0.05f, collides_, clearance_, outline_, path_);
    return {*rollouts_, clearance_, outline_, path_, 10.0f, 0.0f, 10.0f, {}, 0.0f, 0.05f};
  }

  Costmap costmap_{160, 160, 0.05, {-4.0, -4.0}};
  ClearanceMap clearance_{0.8};
  DiscOutline outline_{0.458, 0.416};
  std::unique_ptr<Rollouts> rollouts_;
  CriticPath path_;
  std::vector<float> costs_;
  std::vector<char> collides_;
};

TEST_F(CriticsTest, SurveyFindsTheFurthestPointAndWhatIsBlocked) {
  Make(3, 10);
  MakeStraightPath(60);
  GoStraight(0, 0.05, 0.0);  // Ends at x = 0.5: point 10.
  GoStraight(1, 0.1, 0.1);   // Ends at x = 0.995: point 20.
  GoStraight(2, 0.02, 3.0);
  SetLethal(2.02, 0.1);
  clearance_.Update(costmap_, {0.0, 0.0});
  View();
  EXPECT_EQ(path_.furthest, 20);
  EXPECT_TRUE(path_.is_free[20]);
  EXPECT_FALSE(path_.is_free[40]);  // 0.1 m from the cell's centre, less than 0.208.
  EXPECT_TRUE(path_.is_free[48]);
}

TEST_F(CriticsTest, SurveyPassesOverRolloutsThatCollideAndPointsBehindAWall) {
  // Out for 1 m and back 0.2 m beside it: the end of the path is nearest to the start of the way.
  Make(2, 10);
  for (int i = 0; i <= 40; ++i) {
    path_.x.push_back(i <= 20 ? 0.05f * static_cast<float>(i) : 0.05f * static_cast<float>(40 - i));
    path_.y.push_back(i <= 20 ? 0.0f : 0.2f);
  }
  path_.spacing = 0.05f;
  GoStraight(0, 0.03, 0.5);  // Ends at (0.26, 0.14): nearest to point 35, but it drove 0.3 m.
  GoStraight(1, 0.08, 0.0);  // Ends at point 16.
  View();
  EXPECT_EQ(path_.furthest, 16);
  collides_[1] = 1;
  View();
  EXPECT_EQ(path_.furthest, 5);
  collides_[0] = 1;
  View();
  EXPECT_EQ(path_.furthest, 0);
}

TEST_F(CriticsTest, ConstraintIsTheWayBeyondTheLimits) {
  Make(4, 10);
  MakeStraightPath(5);
  GoStraight(0, 0.15, 0.0);   // 3 m/s, 1 beyond 2, for 10 * 0.05 s.
  GoStraight(1, -0.10, 0.0);  // -2 m/s, 1 beyond -1.
  GoStraight(2, 0.10, 0.0);
  GoStraight(3, 0.05, 0.0);  // At 1 m/s and 3.5 rad/s: 1.5 m/s^2 beyond 2.
  for (int t = 0; t < 10; ++t) rollouts_->angular[rollouts_->Index(t, 3)] = -3.5f;
  MppiConfig limits;
  limits.max_linear = 2.0;
  limits.min_linear = -1.0;
  AddConstraintCost({}, limits, View(), costs_);
  EXPECT_NEAR(costs_[0], 4.0 * 0.5, 1e-5);
  EXPECT_NEAR(costs_[1], 4.0 * 0.5, 1e-5);
  EXPECT_NEAR(costs_[2], 0.0, 1e-5);
  EXPECT_NEAR(costs_[3], 4.0 * 1.5 * 0.5, 1e-5);
}

TEST_F(CriticsTest, ObstacleChargesCollisionsMarginAndNearness) {
  SetLethal(1.0, 0.0);  // Its centre is at (1.025, 0.025).
  Make(4, 20);
  MakeStraightPath(5);
  GoStraight(0, 0.05, 0.0);         // To x = 1: through it.
  GoStraight(1, 0.05, 3.14159265);  // Away from it.
  GoStraight(2, 0.02, 0.0);         // To x = 0.4: 0.425 m short of it in x.
  GoStraight(3, 0.035, 0.0);        // To x = 0.7: in the margin, not touching.
  MppiObstacleConfig config;
  config.point_step = 1;
  config.collision_margin = 0.1;
  std::vector<char> collides(4);
  EXPECT_EQ(AddObstacleCost(config, View(), costs_, collides), 3);
  EXPECT_EQ(collides, (std::vector<char>{1, 0, 0, 0}));
  EXPECT_FLOAT_EQ(costs_[0], 1e5f);
  EXPECT_EQ(costs_[1], 0.0f);
  const auto repulsion = [&](double step) {
    double sum = 0.0;
    for (int t = 0; t < 20; ++t) {
      const CellIndex at = costmap_.CellAt({(t + 1) * step + 1e-6, 0.0});
      const double distance = base::Norm(costmap_.CentreOf(at) - base::Vec2{1.025, 0.025});
      sum += std::max(0.55 - (std::min(distance, 0.8) - 0.208), 0.0);
    }
    return 1.5 * sum / 20.0;
  };
  EXPECT_NEAR(costs_[2], repulsion(0.02), 2e-3);
  // The front disc ends 0.256 m ahead: 0.07 m short of the cell's centre at the end, 0.105 m one
  // step before, each up to 0.035 m off as its centre is in its cell.
  EXPECT_GT(costs_[3], repulsion(0.035) + 20.0 * 0.005);
  EXPECT_LT(costs_[3], repulsion(0.035) + 20.0 * (0.065 + 0.03));
}

TEST_F(CriticsTest, ObstacleDoesNotRepelNearTheGoal) {
  SetLethal(1.0, 0.0);
  Make(1, 20);
  MakeStraightPath(5);
  GoStraight(0, 0.02, 0.0);
  CriticView view = View();
  view.goal_distance = 0.3f;
  std::vector<char> collides(1);
  AddObstacleCost({}, view, costs_, collides);
  EXPECT_EQ(costs_[0], 0.0f);
}

TEST_F(CriticsTest, OverlapAtTheStartAllowsTheWayOut) {
  SetLethal(0.2, 0.0);
  Make(2, 20);
  MakeStraightPath(5);
  GoStraight(0, 0.02, 0.0);
  GoStraight(1, -0.02, 0.0);
  CriticView view = View();
  std::vector<char> collides(2);
  EXPECT_EQ(AddObstacleCost({}, view, costs_, collides), 0);
  view.collision_clearance = outline_.Clearance(clearance_, 0.0f, 0.0f, 1.0f, 0.0f) - 0.01f;
  EXPECT_LT(view.collision_clearance, 0.0f);
  EXPECT_EQ(AddObstacleCost({}, view, costs_, collides), 1);
  EXPECT_EQ(collides, (std::vector<char>{1, 0}));
}

TEST_F(CriticsTest, GoalIsTheMeanDistance) {
  Make(1, 4);
  MakeStraightPath(5);
  GoStraight(0, 0.1, 0.0);
  CriticView view = View();
  AddGoalCost({}, view, costs_);
  EXPECT_EQ(costs_[0], 0.0f);  // Farther than the threshold.
  view.goal_x = 1.0f;
  view.goal_distance = 1.0f;
  AddGoalCost({}, view, costs_);
  EXPECT_NEAR(costs_[0], 5.0 * (0.9 + 0.8 + 0.7 + 0.6) / 4.0, 1e-5);
  MppiGoalConfig squared;
  squared.cost.power = 2;
  costs_[0] = 0.0f;
  AddGoalCost(squared, view, costs_);
  EXPECT_NEAR(costs_[0], 3.75 * 3.75, 1e-4);
}

TEST_F(CriticsTest, PathAlignComparesEqualLengths) {
  Make(2, 41);
  MakeStraightPath(80);
  GoStraight(0, 0.05, 0.0);
  GoStraight(1, 0.05, 0.5);
  const CriticView view = View();
  ASSERT_GE(view.path.furthest, 20);
  AddPathAlignCost({}, view, costs_);
  // Rollout 0: after t + 1 steps 0.05 (t + 1) m, against t steps' length along the path from its
  // first point: 0.05 m behind.
  EXPECT_NEAR(costs_[0], 10.0 * 0.05, 1e-4);
  double sum = 0.0;
  for (int t = 4; t < 41; t += 4) {
    const double way = (t + 1) * 0.05;
    sum += std::hypot(way * std::cos(0.5) - t * 0.05, way * std::sin(0.5));
  }
  EXPECT_NEAR(costs_[1], 10.0 * sum / 10.0, 1e-3);
}

TEST_F(CriticsTest, PathAlignIsSilentOnBlockedPathsAndBeforeTheFirstPoints) {
  Make(1, 41);
  MakeStraightPath(80);
  GoStraight(0, 0.02, 0.5);  // Ends near point 14.
  AddPathAlignCost({}, View(), costs_);
  EXPECT_EQ(costs_[0], 0.0f);
  GoStraight(0, 0.05, 0.5);
  AddPathAlignCost({}, View(), costs_);
  EXPECT_GT(costs_[0], 1.0f);
  costs_[0] = 0.0f;
  SetLethal(1.0, 0.0);  // Blocks 9 of the first 40 points.
  clearance_.Update(costmap_, {0.0, 0.0});
  AddPathAlignCost({}, View(), costs_);
  EXPECT_EQ(costs_[0], 0.0f);
}

TEST_F(CriticsTest, PathFollowDrawsToTheNextFreePointAhead) {
  Make(1, 10);
  MakeStraightPath(80);
  GoStraight(0, 0.1, 0.0);  // Ends at x = 1, point 20; 6 ahead is x = 1.3.
  AddPathFollowCost({}, View(), costs_);
  EXPECT_NEAR(costs_[0], 5.0 * 0.3, 1e-5);
  costs_[0] = 0.0f;
  SetLethal(1.41, 0.01);  // Centre (1.425, 0.025): free again 0.2065 m of x away from it.
  clearance_.Update(costmap_, {0.0, 0.0});
  AddPathFollowCost({}, View(), costs_);
  EXPECT_NEAR(costs_[0], 5.0 * 0.65, 1e-5);
}

TEST_F(CriticsTest, PathAngleTurnsTheRobotTowardsThePath) {
  Make(2, 10);
  MakeStraightPath(80);
  // Both stand still; the second one has turned by half a radian.
  for (int t = 0; t < 10; ++t) {
    rollouts_->cosine[rollouts_->Index(t, 0)] = std::cos(2.0f);
    rollouts_->sine[rollouts_->Index(t, 0)] = std::sin(2.0f);
    rollouts_->cosine[rollouts_->Index(t, 1)] = std::cos(1.5f);
    rollouts_->sine[rollouts_->Index(t, 1)] = std::sin(1.5f);
  }
  CriticView view = View();
  AddPathAngleCost({}, view, costs_);
  EXPECT_EQ(costs_[0], 0.0f);  // The robot itself heads along the path.
  view.start.cosine = std::cos(2.0f);
  view.start.sine = std::sin(2.0f);
  AddPathAngleCost({}, view, costs_);
  EXPECT_NEAR(costs_[0], 2.2 * 2.0, 1e-5);
  EXPECT_NEAR(costs_[1], 2.2 * 1.5, 1e-5);
}

TEST_F(CriticsTest, PreferForwardIsTheWayBackwards) {
  Make(2, 10);
  MakeStraightPath(80);
  GoStraight(0, -0.02, 0.0);
  GoStraight(1, 0.02, 0.0);
  AddPreferForwardCost({}, View(), costs_);
  EXPECT_NEAR(costs_[0], 5.0 * 0.2, 1e-5);
  EXPECT_EQ(costs_[1], 0.0f);
}

}  // namespace
}  // namespace slalom::planners
