#include "planners/teb/homotopy.h"

#include <gtest/gtest.h>

#include <set>

namespace slalom::planners {
namespace {

TEST(Homotopy, TellsTheSidesApart) {
  const std::vector<base::Vec2> points = {{1.0, 0.0}, {2.0, 0.0}};
  const std::vector<base::Vec2> above = {{0.0, 0.0}, {1.0, 0.5}, {2.0, 0.5}, {3.0, 0.0}};
  const std::vector<base::Vec2> high = {{0.0, 0.0}, {0.5, 2.0}, {2.5, 1.0}, {3.0, 0.0}};
  const std::vector<base::Vec2> below = {{0.0, 0.0}, {1.5, -0.5}, {3.0, 0.0}};
  const std::vector<base::Vec2> between = {
      {0.0, 0.0}, {1.0, 0.5}, {1.5, 0.0}, {2.0, -0.5}, {3.0, 0.0}};
  const HomotopyClass a = ClassOf(above, points);
  // Half a turn about each, clockwise.
  EXPECT_NEAR(a[0], -base::kPi, 1e-12);
  EXPECT_NEAR(a[1], -base::kPi, 1e-12);
  EXPECT_TRUE(SameClass(a, ClassOf(high, points)));
  EXPECT_FALSE(SameClass(a, ClassOf(below, points)));
  EXPECT_FALSE(SameClass(a, ClassOf(between, points)));
  EXPECT_FALSE(SameClass(ClassOf(below, points), ClassOf(between, points)));
  EXPECT_TRUE(SameClass(ClassOf(above, {}), ClassOf(below, {})));
}

TEST(Homotopy, TellsALoopFromNone) {
  const std::vector<base::Vec2> points = {{1.0, 0.5}};
  const std::vector<base::Vec2> straight = {{0.0, 0.0}, {2.0, 0.0}};
  const std::vector<base::Vec2> loop = {{0.0, 0.0}, {1.5, 0.0}, {1.5, 1.0},
                                        {0.5, 1.0}, {0.5, 0.0}, {2.0, 0.0}};
  EXPECT_FALSE(SameClass(ClassOf(straight, points), ClassOf(loop, points)));
}

TEST(ObstacleGroups, JoinsWhatIsNearerThanTheGap) {
  Costmap costmap(100, 100, 0.05, {0.0, 0.0});
  // A chain with gaps of 0.4 m, one cell 0.5 m off its end, and one far away.
  for (const double x : {0.5, 0.9, 1.3, 1.7})
    costmap.set_cost(costmap.CellAt({x, 1.01}), kLethalCost);
  costmap.set_cost(costmap.CellAt({2.2, 1.01}), kLethalCost);
  costmap.set_cost(costmap.CellAt({4.5, 4.5}), kLethalCost);
  costmap.set_cost(costmap.CellAt({3.0, 1.0}), kInscribedCost);
  ObstacleGroups groups;
  EXPECT_EQ(groups.Find(costmap, {1.0, 1.0}, 3.0, 0.45).size(), 2u);
  EXPECT_EQ(groups.Find(costmap, {1.0, 1.0}, 3.0, 0.55).size(), 1u);
  EXPECT_EQ(groups.Find(costmap, {1.0, 1.0}, 3.0, 0.2).size(), 5u);
  EXPECT_EQ(groups.Find(costmap, {1.0, 1.0}, 10.0, 0.55).size(), 2u);
}

TEST(Roadmap, ShowsClearWaysForwardOnBothSides) {
  Costmap costmap(120, 120, 0.05, {-1.0, -3.0});
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 120; ++x) {
      if (base::Norm(costmap.CentreOf({x, y}) - base::Vec2{1.5, 0.0}) < 0.3) {
        costmap.set_cost({x, y}, kLethalCost);
      }
    }
  }
  ClearanceMap clearance(0.6);
  clearance.Update(costmap, {0.0, 0.0});
  const std::vector<base::Vec2> centre = {{1.5, 0.0}};
  base::Random random(1);
  RoadmapConfig config;
  config.num_samples = 30;
  std::set<bool> sides;
  int num_ways = 0;
  SearchRoadmap(config, {0.0, 0.0}, {3.0, 0.0}, clearance, random,
                [&](std::span<const base::Vec2> way) {
                  ++num_ways;
                  EXPECT_EQ(way.front(), (base::Vec2{0.0, 0.0}));
                  EXPECT_EQ(way.back(), (base::Vec2{3.0, 0.0}));
                  for (std::size_t i = 0; i + 1 < way.size(); ++i) {
                    EXPECT_GT(way[i + 1].x, way[i].x);
                    for (int k = 0; k <= 50; ++k) {
                      const base::Vec2 p = way[i] + (k / 50.0) * (way[i + 1] - way[i]);
                      // Lethal cells' centres are inside the disc; between two checks a step of
                      // 0.05 m, and cells' centres half a diagonal off.
                      EXPECT_GT(base::Norm(p - centre[0]), 0.25 + 0.3 - 0.036 - 0.036 - 0.025);
                    }
                  }
                  sides.insert(ClassOf(way, centre)[0] > 0.0);
                  return true;
                });
  EXPECT_EQ(sides.size(), 2u);
  EXPECT_GT(num_ways, 3);
  int num_shown = 0;
  config.max_paths = 2;
  SearchRoadmap(config, {0.0, 0.0}, {3.0, 0.0}, clearance, random,
                [&](std::span<const base::Vec2>) { return ++num_shown > 0; });
  EXPECT_EQ(num_shown, 2);
}

TEST(Roadmap, ShowsNoneThroughAWall) {
  Costmap costmap(120, 120, 0.05, {-1.0, -3.0});
  for (int y = 0; y < 120; ++y) costmap.set_cost({50, y}, kLethalCost);
  ClearanceMap clearance(0.6);
  clearance.Update(costmap, {0.0, 0.0});
  base::Random random(2);
  RoadmapConfig config;
  config.width = 4.0;
  SearchRoadmap(config, {0.0, 0.0}, {3.0, 0.0}, clearance, random, [](std::span<const base::Vec2>) {
    ADD_FAILURE();
    return true;
  });
}

}  // namespace
}  // namespace slalom::planners
