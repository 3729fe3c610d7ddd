#include "planners/navigation/obstacle_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "base/random.h"
#include "tests/planners/random_maps.h"

namespace slalom::planners {
namespace {

const PaddedFootprint kFootprint{FootprintConfig{}};

TEST(Inflation, FollowsTheFormula) {
  const Inflation inflation(0.05, 0.265, 0.30, 10.0);
  EXPECT_EQ(inflation.reach(), 6);
  EXPECT_EQ(inflation.CostAt(0, 0), kLethalCost);
  EXPECT_EQ(inflation.CostAt(1, 0), kInscribedCost);
  EXPECT_EQ(inflation.CostAt(5, 0), kInscribedCost);  // 0.25 <= 0.265
  EXPECT_EQ(inflation.CostAt(5, 1), kInscribedCost);  // 0.25495
  EXPECT_EQ(inflation.CostAt(5, 2), 241);             // 252 exp(-10 (0.26926 - 0.265)) = 241.5
  EXPECT_EQ(inflation.CostAt(6, 0), 177);             // 252 exp(-0.35) = 177.58
  EXPECT_EQ(inflation.CostAt(6, 1), kFreeCost);       // Beyond 6 cells.
  EXPECT_EQ(inflation.CostAt(7, 0), kFreeCost);
}

TEST(Inflation, CountsTheInscribedRadiusItselfAsInside) {
  const Inflation inflation(0.05, 0.2, 0.30, 10.0);  // 4 * 0.05 is 0.2 in double precision, too.
  EXPECT_EQ(inflation.CostAt(4, 0), kInscribedCost);
  EXPECT_EQ(inflation.CostAt(0, -4), kInscribedCost);
}

// Oracle: for each cell the nearest obstacle by brute force.
TEST(Inflation, TakesTheNearestObstacle) {
  base::Random random(4);
  for (const double radius : {0.0, 0.3, 0.6}) {
    const Inflation inflation(0.05, 0.265, radius, 10.0);
    Costmap map = DrawMap(50, 0.01, 0.0, 0.0, random);
    const std::vector<std::uint8_t> obstacles(map.costs().begin(), map.costs().end());
    inflation.Apply(obstacles, {0, 0, 50, 50}, map);
    for (int y = 0; y < 50; ++y) {
      for (int x = 0; x < 50; ++x) {
        int nearest = 1 << 20, nearest_dx = 99, nearest_dy = 99;
        for (int oy = 0; oy < 50; ++oy) {
          for (int ox = 0; ox < 50; ++ox) {
            const int d2 = (ox - x) * (ox - x) + (oy - y) * (oy - y);
            if (obstacles[map.Index({ox, oy})] == kLethalCost && d2 < nearest) {
              nearest = d2;
              nearest_dx = ox - x;
              nearest_dy = oy - y;
            }
          }
        }
        EXPECT_EQ(map.cost({x, y}), inflation.CostAt(nearest_dx, nearest_dy));
      }
    }
    // A window comes out as the whole does, and nothing else is written.
    Costmap part(50, 50, 0.05, {});
    Fill(part, {0, 0, 50, 50}, 7);
    const CellWindow window{11, 20, 31, 33};
    inflation.Apply(obstacles, window, part);
    for (int y = 0; y < 50; ++y) {
      for (int x = 0; x < 50; ++x) {
        const bool inside = x >= window.x0 && x < window.x1 && y >= window.y0 && y < window.y1;
        EXPECT_EQ(part.cost({x, y}), inside ? map.cost({x, y}) : 7);
      }
    }
  }
}

env::ScanRays RaysTo(base::Vec2 sensor_O, std::vector<env::ScanRay> rays) {
  return {sensor_O, rays};
}

bool Marked(const ObstacleMap& map, base::Vec2 p_O) {
  const Costmap& costs = map.costmap();
  return map.obstacles()[costs.Index(costs.CellAt(p_O))] == kLethalCost;
}

TEST(ObstacleMap, MarksNearClearsFarther) {
  ObstacleMap map({}, kFootprint);
  map.Reset({});
  const base::Pose2 X_OR;
  const base::Vec2 near{2.42, 0.02}, between{2.72, 0.02}, far{3.2, 0.02};
  map.Update(RaysTo({0.12, 0.0}, {{near, true}}), X_OR);  // 2.3 m away.
  EXPECT_TRUE(Marked(map, near));
  EXPECT_EQ(map.costmap().cost(map.costmap().CellAt(near)), kLethalCost);
  map.Update(RaysTo({0.12, 0.0}, {{between, true}}), X_OR);  // 2.6 m: clears, does not mark.
  EXPECT_FALSE(Marked(map, near));
  EXPECT_FALSE(Marked(map, between));
  map.Update(RaysTo({0.12, 0.0}, {{near, true}}), X_OR);
  map.Update(RaysTo({0.12, 0.0}, {{{2.42, 2.0}, true}}), X_OR);
  EXPECT_TRUE(Marked(map, near)) << "not crossed";
  map.Update(RaysTo({0.12, 0.0}, {{far, true}}), X_OR);  // 3.08 m, 3 of which are cleared.
  EXPECT_FALSE(Marked(map, near));
  map.Update(RaysTo({0.12, 0.0}, {{near, true}}), X_OR);
  map.Update(RaysTo({0.12, 0.0}, {{far, false}}), X_OR);
  EXPECT_TRUE(Marked(map, near)) << "crossed by a beam without an echo";
}

TEST(ObstacleMap, OneHitOfManyBeamsMarks) {
  ObstacleMap map({}, kFootprint);
  map.Reset({});
  // 2.51 and 2.49 m away, in one cell.
  map.Update(RaysTo({0.12, 0.0}, {{{2.63, 0.01}, true}, {{2.61, 0.01}, true}}), {});
  EXPECT_TRUE(Marked(map, {2.61, 0.01}));
}

TEST(ObstacleMap, KeepsWhatTheRobotStandsOnFree) {
  ObstacleMap map({}, kFootprint);
  map.Reset({});
  const env::ScanRays rays = RaysTo({0.12, 0.0}, {{{0.28, 0.0}, true}, {{0.5, 0.0}, true}});
  map.Update(rays, {});
  EXPECT_FALSE(Marked(map, {0.28, 0.0})) << "inside 0.31 m";
  EXPECT_TRUE(Marked(map, {0.5, 0.0}));
}

TEST(ObstacleMap, ReportsWhatChanged) {
  ObstacleMap map({.rolling = false}, kFootprint);
  map.Reset({});
  const env::ScanRays rays = RaysTo({0.12, 0.0}, {{{1.0, 1.0}, true}});
  const CellWindow change = map.Update(rays, {});
  const CellIndex c = map.costmap().CellAt({1.0, 1.0});
  EXPECT_TRUE(c.x - 6 >= change.x0 && c.x + 6 < change.x1 && c.y - 6 >= change.y0 &&
              c.y + 6 < change.y1);
  EXPECT_TRUE(map.Update(rays, {}).empty());
  EXPECT_TRUE(map.ClearOutside({0.0, 0.0}, 2.5).empty());
  EXPECT_FALSE(map.ClearOutside({0.0, 0.0}, 1.8).empty());
  EXPECT_EQ(map.costmap().cost(c), kFreeCost);
}

TEST(ObstacleMap, IsEmptyAfterAReset) {
  for (const bool rolling : {false, true}) {
    ObstacleMap map({.rolling = rolling}, kFootprint);
    map.Reset({});
    map.Update(RaysTo({0.12, 0.0}, {{{1.0, 1.0}, true}}), {});
    map.Update(RaysTo({0.12, 0.5}, {{{1.0, 1.5}, true}}), {{0.0, 0.5}, 0.0});
    map.Reset({3.0, -1.0});
    EXPECT_EQ(map.costmap().CellAt({3.0, -1.0}), ObstacleMap({}, kFootprint).costmap().CellAt({}));
    EXPECT_EQ(std::ranges::count(map.obstacles(), kFreeCost), std::ssize(map.obstacles()));
    EXPECT_EQ(std::ranges::count(map.costmap().costs(), kFreeCost), std::ssize(map.obstacles()));
    EXPECT_TRUE(map.Update(RaysTo({3.0, -1.0}, {}), {{3.0, -1.0}, 0.0}).empty());
  }
}

TEST(ObstacleMap, RollsOverTheGround) {
  ObstacleMap map({.num_cells = 80}, kFootprint);
  map.Reset({});
  const env::ScanRays nothing = RaysTo({0.0, 0.0}, {});
  map.Update(RaysTo({0.0, 0.0}, {{{1.52, 0.52}, true}, {{-1.5, 0.5}, true}}), {});
  ASSERT_TRUE(Marked(map, {1.52, 0.52}));
  ASSERT_TRUE(Marked(map, {-1.5, 0.5}));
  map.Update(nothing, {{1.037, -0.2}, 0.3});  // By 20 and -4 cells.
  EXPECT_NEAR(map.costmap().origin().x, -2.0 + 1.0, 1e-9);
  EXPECT_NEAR(map.costmap().origin().y, -2.0 - 0.2, 1e-9);
  EXPECT_TRUE(Marked(map, {1.52, 0.52}));
  EXPECT_EQ(std::count(map.obstacles().begin(), map.obstacles().end(), kLethalCost), 1);
  map.Update(nothing, {});  // What left the map is forgotten.
  EXPECT_FALSE(Marked(map, {-1.5, 0.5}));
  map.Update(nothing, {{9.0, 9.0}, 0.0});
  EXPECT_EQ(std::count(map.obstacles().begin(), map.obstacles().end(), kLethalCost), 0);
}

/// A scan of what is at random ranges, with the robot at X_OR.
env::ScanRays DrawScan(const base::Pose2& X_OR, base::Random& random) {
  env::ScanRays scan;
  scan.sensor_O = base::Transform(X_OR, {0.12, 0.0});
  double range = 2.0;
  for (int beam = 0; beam < 720; ++beam) {
    if (random.Uniform() < 0.05) range = random.Uniform(0.1, 5.2);
    const auto [s, c] = base::SinCos(X_OR.yaw - 2.356 + beam * 4.712 / 719);
    scan.rays.push_back({scan.sensor_O + std::min(range, 5.0) * base::Vec2{c, s}, range < 5.0});
  }
  return scan;
}

/// The rule of the header, beam by beam and cell by cell, on a map that stays.
class SlowMap {
 public:
  explicit SlowMap(const Costmap& like) : map_(like) { Fill(map_, {0, 0, 200, 200}, kFreeCost); }

  void Update(const env::ScanRays& scan, const base::Pose2& X_OR) {
    const CellIndex from = map_.CellAt(scan.sensor_O);
    for (const env::ScanRay& ray : scan.rays) {
      if (!ray.hit) continue;
      const CellIndex to = map_.CellAt(ray.p_O);
      const int dx = to.x - from.x, dy = to.y - from.y;
      const int longer = std::max(std::abs(dx), std::abs(dy));
      const int shorter = std::min(std::abs(dx), std::abs(dy));
      const double length = std::hypot(dx, dy);
      const int end = length > 60.0 ? static_cast<int>(60.0 / length * longer) : longer;
      for (int i = 0; i <= end; ++i) {
        const int across = longer == 0 ? 0 : (i * shorter + longer / 2) / longer;
        const bool along_x = std::abs(dx) >= std::abs(dy);
        const int ax = along_x ? i : across, ay = along_x ? across : i;
        Set({from.x + (dx >= 0 ? ax : -ax), from.y + (dy >= 0 ? ay : -ay)}, kFreeCost);
      }
    }
    for (const env::ScanRay& ray : scan.rays) {
      if (ray.hit && base::Norm(ray.p_O - scan.sensor_O) < 2.5) {
        Set(map_.CellAt(ray.p_O), kLethalCost);
      }
    }
    std::vector<CellIndex> under;
    CoveredCells(map_, kFootprint, X_OR, under);
    for (const CellIndex c : under) Set(c, kFreeCost);
  }

  const Costmap& map() const { return map_; }

 private:
  void Set(CellIndex c, std::uint8_t cost) {
    if (map_.Contains(c)) map_.set_cost(c, cost);
  }

  Costmap map_;
};

// With an inflation radius of 1.5 m, costs change beyond the window of cells that a scan can
// change.
TEST(ObstacleMap, AgreesWithTheSlowRule) {
  for (const auto& [radius, scaling] : {std::pair{0.3, 10.0}, {1.5, 1.0}}) {
    base::Random random(5);
    ObstacleMap fast({.rolling = false, .inflation_radius = radius, .cost_scaling = scaling},
                     kFootprint);
    fast.Reset({});
    SlowMap slow(fast.costmap());
    const Inflation inflation(0.05, 0.265, radius, scaling);
    for (int step = 0; step < 60; ++step) {
      // Near the edge too, where beams leave the map.
      const base::Pose2 X_OR{{random.Uniform(-4.5, 4.5), random.Uniform(-4.5, 4.5)},
                             random.Uniform(-3.0, 3.0)};
      const env::ScanRays scan = DrawScan(X_OR, random);
      fast.Update(scan, X_OR);
      slow.Update(scan, X_OR);
      ASSERT_TRUE(
          std::equal(fast.obstacles().begin(), fast.obstacles().end(), slow.map().costs().begin()))
          << "step " << step;
      Costmap inflated = slow.map();
      inflation.Apply(fast.obstacles(), {0, 0, 200, 200}, inflated);
      ASSERT_TRUE(std::equal(inflated.costs().begin(), inflated.costs().end(),
                             fast.costmap().costs().begin()))
          << "step " << step;
    }
  }
}

// Oracle: the costs of all cells, computed from all obstacles.
TEST(ObstacleMap, CostsAreThoseOfAllItsObstacles) {
  for (const bool rolling : {false, true}) {
    for (const auto& [radius, scaling] : {std::pair{0.3, 10.0}, {1.5, 1.0}}) {
      base::Random random(6);
      ObstacleMap map({.num_cells = 110,
                       .rolling = rolling,
                       .inflation_radius = radius,
                       .cost_scaling = scaling},
                      kFootprint);
      map.Reset({});
      const Inflation inflation(0.05, 0.265, radius, scaling);
      base::Pose2 X_OR;
      for (int step = 0; step < 150; ++step) {
        // Mostly by a few cells, at times by more than the map is wide.
        const double most = step % 40 == 39 ? 8.0 : step % 3 == 0 ? 0.4 : 0.06;
        X_OR.p = X_OR.p + base::Vec2{random.Uniform(-most, most), random.Uniform(-most, most)};
        if (!rolling && base::Norm(X_OR.p) > 3.0) X_OR.p = {};
        X_OR.yaw = random.Uniform(-3.0, 3.0);
        const env::ScanRays scan = DrawScan(X_OR, random);
        const Costmap before = map.costmap();
        CellWindow changed;
        if (step % 10 == 7) map.Mark(scan, X_OR);
        if (step % 25 == 12) changed = map.ClearOutside(X_OR.p, 1.5);
        changed = Union(changed, map.Update(scan, X_OR));
        Costmap all = map.costmap();
        inflation.Apply(map.obstacles(), {0, 0, 110, 110}, all);
        ASSERT_TRUE(std::ranges::equal(all.costs(), map.costmap().costs())) << "step " << step;
        for (int y = 0; y < 110; ++y) {
          for (int x = 0; x < 110; ++x) {
            const bool inside =
                x >= changed.x0 && x < changed.x1 && y >= changed.y0 && y < changed.y1;
            ASSERT_TRUE(inside || before.cost({x, y}) == map.costmap().cost({x, y}))
                << "not reported, step " << step;
          }
        }
      }
    }
  }
}

TEST(ScanProjector, PutsBeamsIntoO) {
  const env::ScanProjector projector({.num_beams = 3, .field_of_view = base::kPi});
  env::ScanRays rays;
  const std::vector<std::uint16_t> ranges = {100, 200, 500};
  projector.Project(ranges, {{1.0, 2.0}, 0.5 * base::kPi}, rays);
  EXPECT_NEAR(rays.sensor_O.x, 1.0, 1e-12);
  EXPECT_NEAR(rays.sensor_O.y, 2.12, 1e-12);
  EXPECT_NEAR(rays.rays[0].p_O.x, 2.0, 1e-12);  // Right of +y is +x.
  EXPECT_NEAR(rays.rays[0].p_O.y, 2.12, 1e-12);
  EXPECT_NEAR(rays.rays[1].p_O.x, 1.0, 1e-12);
  EXPECT_NEAR(rays.rays[1].p_O.y, 4.12, 1e-12);
  EXPECT_TRUE(rays.rays[1].hit);
  EXPECT_FALSE(rays.rays[2].hit) << "at the clip";
}

}  // namespace
}  // namespace slalom::planners
