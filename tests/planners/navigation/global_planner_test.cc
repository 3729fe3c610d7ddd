#include "planners/navigation/global_planner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "base/random.h"
#include "tests/planners/random_maps.h"

namespace slalom::planners {
namespace {

using testing::IsEmpty;
using testing::Not;

constexpr float kInfinite = std::numeric_limits<float>::infinity();

CellWindow Whole(const Costmap& map) { return {0, 0, map.size_x(), map.size_y()}; }

/// The fixed point of navfn's update, by sweeps over all cells until nothing falls any more.
std::vector<float> PotentialBySweeps(const Costmap& map, CellIndex robot) {
  const int nx = map.size_x(), ny = map.size_y();
  std::vector<float> potential(map.costs().size(), kInfinite);
  potential[map.Index(robot)] = 0.0f;
  const auto at = [&](int x, int y) { return potential[map.Index({x, y})]; };
  for (bool changed = true; changed;) {
    changed = false;
    for (int y = 1; y < ny - 1; ++y) {
      for (int x = 1; x < nx - 1; ++x) {
        const int cost = CellIndex{x, y} == robot ? 0 : map.cost({x, y});
        if (cost >= kInscribedCost) continue;
        const float crossing = std::floor(50.0f + 0.8f * static_cast<float>(cost));
        const float a = std::min(at(x - 1, y), at(x + 1, y));
        const float b = std::min(at(x, y - 1), at(x, y + 1));
        const float low = std::min(a, b), high = std::max(a, b);
        if (low == kInfinite) continue;
        float p = low + crossing;
        if (high - low < crossing) {
          const float d = (high - low) / crossing;
          p = low + crossing * std::min(1.0f, -0.2301f * d * d + 0.5307f * d + 0.7040f);
        }
        if (p < at(x, y)) {
          potential[map.Index({x, y})] = p;
          changed = true;
        }
      }
    }
  }
  return potential;
}

TEST(GlobalPlanner, KnownPotentials) {
  Costmap map(9, 5, 0.05, {});
  Fill(map, {5, 0, 6, 5}, kInscribedCost);
  map.set_cost({5, 2}, 100);  // The way through.
  GlobalPlanner planner(GlobalPlanner::Extent::kEverywhere);
  ASSERT_THAT(planner.Plan(map, {}, map.CentreOf({2, 2}), map.CentreOf({6, 2})), Not(IsEmpty()));
  EXPECT_FLOAT_EQ(planner.potential({2, 2}), 0.0f);
  EXPECT_FLOAT_EQ(planner.potential({3, 2}), 50.0f);
  EXPECT_FLOAT_EQ(planner.potential({2, 3}), 50.0f);
  EXPECT_FLOAT_EQ(planner.potential({3, 3}), 50.0f + 0.704f * 50.0f);
  EXPECT_FLOAT_EQ(planner.potential({4, 2}), 100.0f);
  EXPECT_FLOAT_EQ(planner.potential({5, 2}), 100.0f + 130.0f);  // 50 + 0.8 * 100
  EXPECT_EQ(planner.potential({0, 2}), kInfinite) << "the edge is a wall";
}

TEST(GlobalPlanner, PotentialIsTheFixedPoint) {
  base::Random random(6);
  for (int trial = 0; trial < 20; ++trial) {
    const Costmap map = DrawMap(40, 0.1, 0.1, 0.3, random);
    CellIndex start{20, 20}, goal{5, 6};
    if (map.cost(goal) >= kInscribedCost) continue;
    GlobalPlanner planner(GlobalPlanner::Extent::kEverywhere);
    planner.Plan(map, {}, map.CentreOf(start), map.CentreOf(goal));
    const std::vector<float> expected = PotentialBySweeps(map, start);
    for (int y = 0; y < 40; ++y) {
      for (int x = 0; x < 40; ++x) {
        EXPECT_EQ(planner.potential({x, y}), expected[map.Index({x, y})]) << x << " " << y;
      }
    }
  }
}

// As navfn's: the way back from the goal of a wave that began at the robot, on cells' lower
// corners.
TEST(GlobalPlanner, PathRunsAlongLowerCornersOfCells) {
  const Costmap map(60, 60, 0.05, {-1.0, -1.0});
  GlobalPlanner planner;
  const auto& path =
      planner.Plan(map, {}, {0.02, 0.03}, {0.53, 0.04});  // Cells (20, 20), (30, 20).
  ASSERT_EQ(path.size(), 21u);
  EXPECT_NEAR(path.front().x, 0.0, 1e-12);
  EXPECT_NEAR(path.front().y, 0.0, 1e-12);
  for (std::size_t i = 1; i + 1 < path.size(); ++i) {
    EXPECT_NEAR(path[i].x, 0.025 * static_cast<double>(i + 1), 1e-9) << i;
    EXPECT_NEAR(path[i].y, 0.0, 1e-9);
  }
  EXPECT_EQ(path.back(), (base::Vec2{0.53, 0.04}));
  EXPECT_EQ(planner.potential({20, 20}), 0.0f) << "the robot's";
  EXPECT_EQ(planner.potential({30, 20}), 500.0f);
}

TEST(GlobalPlanner, CrossesFreeSpaceStraight) {
  const Costmap map(800, 800, 0.05, {-20.0, -20.0});
  GlobalPlanner planner;
  for (const base::Vec2 goal : {base::Vec2{10.0, 0.0}, base::Vec2{6.0, 8.0}}) {
    const auto& path = planner.Plan(map, {}, {0.01, 0.01}, goal);
    ASSERT_THAT(path, Not(IsEmpty()));
    EXPECT_LE(base::Norm(path.front()), 0.05);
    EXPECT_EQ(path.back(), goal);
    double length = 0.0;
    for (std::size_t i = 1; i < path.size(); ++i) length += base::Norm(path[i] - path[i - 1]);
    EXPECT_NEAR(length, 10.0, 0.1);  // A cell at either end.
    for (const base::Vec2 p : path) {
      EXPECT_LT(std::fabs(base::Cross((0.1) * goal, p)), 0.15) << "beside the straight line";
    }
  }
}

/// A map of blobs with inflation-like rims, as the planner meets them.
Costmap DrawBlobs(int size, int num_blobs, base::Random& random) {
  Costmap map(size, size, 0.05, {});
  for (int i = 0; i < num_blobs; ++i) {
    const int cx = static_cast<int>(random.UniformInt(size));
    const int cy = static_cast<int>(random.UniformInt(size));
    for (int y = std::max(0, cy - 7); y < std::min(size, cy + 8); ++y) {
      for (int x = std::max(0, cx - 7); x < std::min(size, cx + 8); ++x) {
        const double d = std::hypot(x - cx, y - cy);
        const int cost = d < 5.0 ? kInscribedCost : static_cast<int>(252.0 * std::exp(4.0 - d));
        map.set_cost({x, y}, std::max(map.cost({x, y}), static_cast<std::uint8_t>(cost)));
      }
    }
  }
  return map;
}

TEST(GlobalPlanner, NeverCrossesWalls) {
  base::Random random(7);
  int num_paths = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const Costmap map = DrawBlobs(120, 40, random);
    const base::Vec2 start{random.Uniform(0.2, 5.8), random.Uniform(0.2, 5.8)};
    const base::Vec2 goal{random.Uniform(0.2, 5.8), random.Uniform(0.2, 5.8)};
    const CellIndex s = map.CellAt(start), g = map.CellAt(goal);
    GlobalPlanner planner;
    const auto& path = planner.Plan(map, {}, start, goal);
    const std::vector<float> potential = PotentialBySweeps(map, s);
    const bool reachable = map.cost(g) < kInscribedCost && potential[map.Index(g)] < kInfinite;
    EXPECT_EQ(!path.empty(), reachable) << trial;
    num_paths += !path.empty();
    for (const base::Vec2 p : path) {
      // A point is half a cell below and left of where it was planned.
      const bool planned = p != goal;
      const CellIndex c = map.CellAt(planned ? p + base::Vec2{0.025, 0.025} : p);
      EXPECT_TRUE(c == s || map.cost(c) < kInscribedCost) << trial;
    }
  }
  EXPECT_GT(num_paths, 20);
}

// What is kept from plan to plan, and what is left unspread, must not show.
TEST(GlobalPlanner, PlansAsIfFromNothing) {
  base::Random random(8);
  GlobalPlanner kept;
  Costmap map = DrawBlobs(160, 50, random);
  base::Vec2 start{1.0, 1.0};
  const base::Vec2 goal{7.0, 7.1};
  Fill(map, {135, 135, 146, 146}, kFreeCost);
  int num_paths = 0;
  for (int step = 0; step < 180; ++step) {
    CellWindow changed;
    if (step % 2 == 0) {  // A few cells change, as under a flickering scan.
      const int x = static_cast<int>(random.UniformInt(125)),
                y = static_cast<int>(random.UniformInt(125));
      changed = {x, y, x + 5, y + 5};
      Fill(map, changed,
           random.Uniform() < 0.4 ? kInscribedCost
                                  : static_cast<std::uint8_t>(random.UniformInt(200)));
    }
    if (step % 3 != 0) {  // Else the robot stands.
      start = start + base::Vec2{random.Uniform(-0.08, 0.1), random.Uniform(-0.08, 0.1)};
      start = {std::clamp(start.x, 0.2, 6.0), std::clamp(start.y, 0.2, 6.0)};
    }
    const std::vector<base::Vec2> path = kept.Plan(map, changed, start, goal);
    GlobalPlanner fresh(GlobalPlanner::Extent::kEverywhere);
    ASSERT_EQ(path, fresh.Plan(map, Whole(map), start, goal)) << "step " << step;
    num_paths += !path.empty();
  }
  EXPECT_GT(num_paths, 60);
}

TEST(GlobalPlanner, FindsNoneWhereThereIsNone) {
  Costmap map(60, 60, 0.05, {});
  GlobalPlanner planner;
  const base::Vec2 start{0.5, 0.5}, goal{2.5, 2.5};
  EXPECT_THAT(planner.Plan(map, {}, start, {9.0, 0.5}), IsEmpty()) << "goal off the map";
  EXPECT_THAT(planner.Plan(map, {}, start, goal), Not(IsEmpty()));
  Fill(map, {0, 30, 60, 31}, kInscribedCost);
  EXPECT_THAT(planner.Plan(map, Whole(map), start, goal), IsEmpty());
  Fill(map, {20, 30, 21, 31}, kFreeCost);
  EXPECT_THAT(planner.Plan(map, Whole(map), start, goal), Not(IsEmpty())) << "a gap of one cell";
  map.set_cost(map.CellAt(goal), kInscribedCost);
  EXPECT_THAT(planner.Plan(map, Whole(map), start, goal), IsEmpty()) << "goal in an obstacle";
}

TEST(GlobalPlanner, LeavesAnObstacleThatTheRobotIsIn) {
  Costmap map(60, 60, 0.05, {});
  Fill(map, {10, 10, 11, 13}, kInscribedCost);
  GlobalPlanner planner;
  EXPECT_THAT(planner.Plan(map, {}, map.CentreOf({10, 11}), {2.5, 2.5}), Not(IsEmpty()));
  Fill(map, {9, 9, 12, 14}, kInscribedCost);  // Walls all round.
  EXPECT_THAT(planner.Plan(map, Whole(map), map.CentreOf({10, 11}), {2.5, 2.5}), IsEmpty());
}

}  // namespace
}  // namespace slalom::planners
