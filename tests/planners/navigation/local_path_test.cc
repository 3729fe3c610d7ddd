#include "planners/navigation/local_path.h"

#include <gtest/gtest.h>

#include <vector>

namespace slalom::planners {
namespace {

TEST(LocalPath, HasPointsAtEqualDistances) {
  const std::vector<base::Vec2> path = {{0.0, 0.0}, {1.0, 0.0}, {1.0, 1.0}};
  LocalPath local;
  CutLocalPath(path, {0.3, 0.2}, 1.0, 1.2, 0.25, local);
  ASSERT_EQ(local.points.size(), 5u);
  const base::Vec2 expected[] = {{0.3, 0.0}, {0.55, 0.0}, {0.8, 0.0}, {1.0, 0.05}, {1.0, 0.3}};
  for (std::size_t i = 0; i < local.points.size(); ++i) {
    EXPECT_NEAR(base::Norm(local.points[i] - expected[i]), 0.0, 1e-12) << i;
  }
  EXPECT_FALSE(local.ends_at_goal);
}

TEST(LocalPath, EndsAtTheGoal) {
  const std::vector<base::Vec2> path = {{0.0, 0.0}, {1.0, 0.0}, {1.0, 0.1}};
  LocalPath local;
  CutLocalPath(path, {0.0, 0.0}, 1.0, 5.0, 0.25, local);
  EXPECT_TRUE(local.ends_at_goal);
  EXPECT_EQ(local.points.size(), 6u);
  EXPECT_EQ(local.points.back(), path.back());
}

TEST(LocalPath, OfOnePointIsThatPoint) {
  const std::vector<base::Vec2> path = {{2.0, 3.0}};
  LocalPath local;
  CutLocalPath(path, {0.0, 0.0}, 1.0, 5.0, 0.25, local);
  ASSERT_EQ(local.points.size(), 1u);
  EXPECT_EQ(local.points.front(), path.front());
}

TEST(LocalPath, DoesNotJumpToTheWayBack) {
  // Out along y = 0, back along y = 0.2: the robot at y = 0.15 is nearer to the way back.
  const std::vector<base::Vec2> path = {{0.0, 0.0}, {4.0, 0.0}, {4.0, 0.2}, {0.0, 0.2}};
  LocalPath local;
  CutLocalPath(path, {0.5, 0.15}, 1.0, 1.0, 0.1, local);
  EXPECT_NEAR(local.points.front().y, 0.0, 1e-12);
  CutLocalPath(path, {0.5, 0.15}, 100.0, 1.0, 0.1, local);
  EXPECT_NEAR(local.points.front().y, 0.2, 1e-12);
}

}  // namespace
}  // namespace slalom::planners
