#include "planners/navigation/distance_grid.h"

#include <gtest/gtest.h>

#include <vector>

#include "base/random.h"
#include "tests/planners/random_maps.h"

namespace slalom::planners {
namespace {

TEST(DistanceGrid, GoesRoundWalls) {
  Costmap map(5, 4, 0.05, {});
  Fill(map, {2, 0, 3, 3}, kInscribedCost);  // A wall with a way round at the top.
  DistanceGrid grid;
  const std::vector<CellIndex> target = {{3, 0}};
  grid.Start(map, {}, target);
  EXPECT_EQ(grid.Distance({3, 0}), 0);
  EXPECT_EQ(grid.Distance({4, 3}), 4);
  EXPECT_EQ(grid.Distance({1, 0}), 8);  // Up 3, left 2, down 3.
  EXPECT_EQ(grid.Distance({2, 1}), DistanceGrid::kNoWay);
  const std::vector<CellIndex> under_robot = {{2, 0}};
  grid.Start(map, under_robot, target);
  EXPECT_EQ(grid.Distance({1, 0}), 2) << "the robot's own cells let through";
  map.set_cost({2, 3}, kLethalCost);
  grid.Start(map, {}, target);
  EXPECT_EQ(grid.Distance({1, 0}), DistanceGrid::kNoWay);
}

// Oracle: relaxation until nothing changes.
TEST(DistanceGrid, AgreesWithRelaxation) {
  base::Random random(9);
  for (int trial = 0; trial < 20; ++trial) {
    const Costmap map = DrawMap(30, 0.15, 0.15, 0.2, random);
    std::vector<CellIndex> targets, under_robot;
    for (int i = 0; i < 4; ++i) {
      const auto draw = [&] { return static_cast<int>(random.UniformInt(30)); };
      targets.push_back({draw(), draw()});
      under_robot.push_back({draw(), draw()});
    }
    targets.push_back(targets[0]);  // Twice the same does no harm.
    DistanceGrid grid;
    grid.Start(map, under_robot, targets);

    const int far = DistanceGrid::kNoWay;
    std::vector<int> expected(900, far);
    for (const CellIndex c : targets) expected[map.Index(c)] = 0;
    for (bool changed = true; changed;) {
      changed = false;
      for (int y = 0; y < 30; ++y) {
        for (int x = 0; x < 30; ++x) {
          const bool exempt =
              std::count(under_robot.begin(), under_robot.end(), CellIndex{x, y}) > 0;
          if (map.cost({x, y}) >= kInscribedCost && !exempt) continue;
          for (const CellIndex d : {CellIndex{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
            const CellIndex n{x + d.x, y + d.y};
            if (!map.Contains(n) || expected[map.Index(n)] == far) continue;
            if (expected[map.Index(n)] + 1 < expected[map.Index({x, y})]) {
              expected[map.Index({x, y})] = expected[map.Index(n)] + 1;
              changed = true;
            }
          }
        }
      }
    }
    for (int y = 0; y < 30; ++y) {
      for (int x = 0; x < 30; ++x) EXPECT_EQ(grid.Distance({x, y}), expected[map.Index({x, y})]);
    }
  }
}

}  // namespace
}  // namespace slalom::planners
