#include "planners/elastic_band/elastic_band.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random.h"
#include "planners/elastic_band/elastic_band_planner.h"
#include "planners/navigation/global_planner.h"
#include "planners/navigation/inflation.h"
#include "tests/planners/random_maps.h"

namespace slalom::planners {
namespace {

const double kLargest = std::log(252.0) / 10.0;  // Radius in the open, 0.553 m.

/// A 10 x 10 m map round the origin of O; costs fall slowly, so that bubbles differ in size.
Costmap MapOf(const std::vector<base::Vec2>& obstacles_O) {
  Costmap map(200, 200, 0.05, {-5.0, -5.0});
  std::vector<std::uint8_t> cells(map.costs().size(), kFreeCost);
  for (const base::Vec2 p_O : obstacles_O) cells[map.Index(map.CellAt(p_O))] = kLethalCost;
  Inflation(0.05, 0.265, 0.8, 10.0).Apply(cells, {0, 0, 200, 200}, map);
  return map;
}

std::vector<base::Vec2> Line(base::Vec2 from_O, base::Vec2 to_O, int num_points) {
  std::vector<base::Vec2> points;
  for (int i = 0; i < num_points; ++i) {
    points.push_back(from_O + (static_cast<double>(i) / (num_points - 1)) * (to_O - from_O));
  }
  return points;
}

void ExpectWhole(const ElasticBand& band, const BandField& field) {
  ASSERT_GE(band.bubbles().size(), 2u);
  for (std::size_t i = 0; i < band.bubbles().size(); ++i) {
    const Bubble& b = band.bubbles()[i];
    EXPECT_GT(b.radius, 0.0);
    EXPECT_EQ(b.radius, field.Clearance(b.p_O));
    if (i == 0) continue;
    const Bubble& a = band.bubbles()[i - 1];
    EXPECT_LT(base::Norm(b.p_O - a.p_O), 0.7 * (a.radius + b.radius)) << "gap before " << i;
  }
}

TEST(BandField, ReadsDistancesOffCosts) {
  Costmap map = MapOf({});
  map.set_cost({100, 100}, 100);
  map.set_cost({101, 100}, kInscribedCost);
  map.set_cost({102, 100}, kUnknownCost);
  const BandField field(map, 10.0, false);
  EXPECT_NEAR(field.Clearance({0.01, 0.01}), std::log(2.52) / 10.0, 1e-12);
  EXPECT_EQ(field.Clearance({0.06, 0.01}), 0.0);
  EXPECT_NEAR(field.Clearance({0.11, 0.01}), kLargest, 1e-12);
  EXPECT_NEAR(field.Clearance({-1.0, 1.0}), kLargest, 1e-12);
  EXPECT_NEAR(field.Clearance({99.0, 0.0}), kLargest, 1e-12) << "off the map";
  EXPECT_NEAR(BandField(map, 10.0, true).Clearance({0.06, 0.01}), kLargest, 1e-12) << "blind";
}

TEST(ElasticBand, KeepsTheBubblesThatItNeeds) {
  const Costmap map = MapOf({});
  const BandField field(map, 10.0, false);
  ElasticBand band({});
  ASSERT_TRUE(band.SetPath(field, Line({0.0, 0.0}, {3.0, 0.0}, 121)));
  ExpectWhole(band, field);
  // Bubbles of one radius overlap below 1.4 * 0.553 = 0.774 m; each second gap must be larger.
  const auto bubbles = band.bubbles();
  EXPECT_LE(bubbles.size(), 9u);
  EXPECT_GE(bubbles.size(), 5u);
  for (std::size_t i = 2; i < bubbles.size(); ++i) {
    EXPECT_GE(base::Norm(bubbles[i].p_O - bubbles[i - 2].p_O), 1.4 * kLargest - 1e-9);
  }
  // Two points far apart: the gap is filled.
  ASSERT_TRUE(band.SetPath(field, Line({0.0, 0.0}, {3.0, 0.0}, 2)));
  ExpectWhole(band, field);
}

TEST(ElasticBand, ForcesByHand) {
  const Costmap map = MapOf({});
  const BandField field(map, 10.0, false);
  ElasticBand band({});
  ASSERT_TRUE(band.SetPath(field, std::vector<base::Vec2>{{0.0, 0.0}, {0.6, 0.3}, {1.2, 0.0}}));
  ASSERT_EQ(band.bubbles().size(), 3u);
  // Each neighbour pulls with a force of 1, down by 0.3 / sqrt(0.45) = 0.4472.
  const base::Vec2 force = band.Force(field, 1, band.bubbles()[1]);
  EXPECT_NEAR(force.x, 0.0, 1e-12);
  EXPECT_NEAR(force.y, -2.0 * 0.3 / std::sqrt(0.45), 1e-12);
  // Nearer to one end: what would slide it along the band is taken out.
  const Bubble aside{{0.3, 0.3}, kLargest};
  EXPECT_NEAR(band.Force(field, 1, aside).x, 0.0, 1e-12);
  EXPECT_NEAR(band.Force(field, 1, aside).y,
              -0.3 / std::hypot(0.3, 0.3) - 0.3 / std::hypot(0.9, 0.3), 1e-12);
}

TEST(ElasticBand, ObstaclesPushByTheSlopeOfTheClearance) {
  Costmap map = MapOf({});
  Fill(map, {0, 101, 200, 200}, 50);  // y >= 0.05: clearance ln(252 / 50) / 10 = 0.1617.
  const BandField field(map, 10.0, false);
  ElasticBand band({});
  ASSERT_TRUE(band.SetPath(field, std::vector<base::Vec2>{{-0.5, 0.0}, {0.0, 0.0}, {0.5, 0.0}}));
  ASSERT_EQ(band.bubbles().size(), 3u);
  const Bubble bubble{{0.0, 0.0}, 0.3};
  // Gain 2; from clearance 0.553 below to 0.1617 above over 0.6 m.
  const double expected = 2.0 * (std::log(252.0 / 50.0) / 10.0 - kLargest) / 0.6;
  EXPECT_NEAR(band.Force(field, 1, bubble).y, expected, 1e-12);
  EXPECT_NEAR(band.Force(field, 1, bubble).x, 0.0, 1e-12);
}

TEST(ElasticBand, StraightensInTheOpen) {
  const Costmap map = MapOf({});
  const BandField field(map, 10.0, false);
  std::vector<base::Vec2> bow = Line({0.0, 0.0}, {1.5, 1.0}, 40);
  for (const base::Vec2 p : Line({1.5, 1.0}, {3.0, 0.0}, 40)) bow.push_back(p);
  ElasticBand band({});
  ASSERT_TRUE(band.SetPath(field, bow));
  for (int cycle = 0; cycle < 20; ++cycle) ASSERT_TRUE(band.Optimise(field));
  ExpectWhole(band, field);
  for (const Bubble& b : band.bubbles()) EXPECT_LT(std::fabs(b.p_O.y), 0.1);
  EXPECT_EQ(band.bubbles().front().p_O, (base::Vec2{0.0, 0.0}));
  EXPECT_EQ(band.bubbles().back().p_O, (base::Vec2{3.0, 0.0}));
}

TEST(ElasticBand, MovesToTheMiddleOfACorridor) {
  std::vector<base::Vec2> walls = Line({-2.0, 0.72}, {2.0, 0.72}, 161);
  for (const base::Vec2 p : Line({-2.0, -0.72}, {2.0, -0.72}, 161)) walls.push_back(p);
  const Costmap map = MapOf(walls);
  const BandField field(map, 10.0, false);
  ElasticBand band({});
  ASSERT_TRUE(band.SetPath(field, Line({-1.5, 0.0}, {1.5, 0.0}, 121)));
  // Begin beside the middle, ends held there.
  std::vector<base::Vec2> bent = Line({-1.5, 0.0}, {-1.2, 0.25}, 12);
  for (const base::Vec2 p : Line({-1.2, 0.25}, {1.2, 0.25}, 96)) bent.push_back(p);
  for (const base::Vec2 p : Line({1.2, 0.25}, {1.5, 0.0}, 12)) bent.push_back(p);
  ASSERT_TRUE(band.SetPath(field, bent));
  for (int cycle = 0; cycle < 20; ++cycle) ASSERT_TRUE(band.Optimise(field));
  ExpectWhole(band, field);
  for (const Bubble& b : band.bubbles()) EXPECT_LT(std::fabs(b.p_O.y), 0.11) << b.p_O.x;
}

TEST(ElasticBand, RefusesObstaclesAndStaysAsItWas) {
  Costmap map = MapOf({});
  const BandField field(map, 10.0, false);
  ElasticBand band({});
  ASSERT_TRUE(band.SetPath(field, Line({0.0, 0.0}, {2.0, 0.0}, 81)));
  const std::vector<Bubble> before(band.bubbles().begin(), band.bubbles().end());
  Fill(map, {119, 90, 122, 110}, kInscribedCost);  // Across x = 1.
  EXPECT_FALSE(band.SetPath(field, Line({0.0, 0.0}, {2.0, 0.0}, 81)));
  EXPECT_FALSE(band.SetPath(field, Line({0.0, 0.0}, {2.0, 0.0}, 2))) << "in the gap";
  EXPECT_FALSE(band.BeginAt(field, {1.0, 0.0})) << "robot in an obstacle";
  ASSERT_EQ(band.bubbles().size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_EQ(band.bubbles()[i].p_O, before[i].p_O);
}

TEST(ElasticBand, BeginsAtTheRobot) {
  const Costmap map = MapOf({});
  const BandField field(map, 10.0, false);
  ElasticBand band({});
  EXPECT_FALSE(band.BeginAt(field, {0.0, 0.0})) << "no band";
  ASSERT_TRUE(band.SetPath(field, Line({0.0, 0.0}, {3.0, 0.0}, 121)));
  ASSERT_TRUE(band.BeginAt(field, {1.0, 0.1}));
  ExpectWhole(band, field);
  EXPECT_EQ(band.bubbles()[0].p_O, (base::Vec2{1.0, 0.1}));
  EXPECT_GT(band.bubbles()[1].p_O.x, 1.0);
  ASSERT_TRUE(band.BeginAt(field, {1.0, 2.5})) << "from afar, over a filled gap";
  ExpectWhole(band, field);
}

// Random maps and navfn's paths: whatever the band does, it stays whole.
TEST(ElasticBand, StaysWholeOnRandomMaps) {
  base::Random random(11);
  int num_bands = 0;
  for (int trial = 0; trial < 60; ++trial) {
    std::vector<base::Vec2> obstacles;
    for (int i = 0; i < 40; ++i) {
      obstacles.push_back({random.Uniform(-4.0, 4.0), random.Uniform(-4.0, 4.0)});
    }
    const Costmap map = MapOf(obstacles);
    const BandField field(map, 10.0, false);
    GlobalPlanner planner;
    const auto path =
        planner.Plan(map, {}, {-3.0, random.Uniform(-3.0, 3.0)}, {3.0, random.Uniform(-3.0, 3.0)});
    ElasticBand band({});
    if (path.empty() || !band.SetPath(field, path)) continue;
    ++num_bands;
    ExpectWhole(band, field);
    for (int cycle = 0; cycle < 5; ++cycle) {
      if (!band.Optimise(field)) break;
      ExpectWhole(band, field);
    }
  }
  EXPECT_GT(num_bands, 20);
}

LocalView ViewOf(const Costmap& map, const std::vector<base::Vec2>& path, double yaw) {
  return {.X_OR = {{0.0, 0.0}, yaw},
          .velocity = {},
          .costmap = map,
          .path_O = path,
          .path_is_new = true,
          .goal_O = path.back()};
}

TEST(ElasticBandPlanner, DrivesByItsBubble) {
  const Costmap map = MapOf({});
  const std::vector<base::Vec2> path = Line({0.0, 0.0}, {8.0, 0.0}, 321);
  ElasticBandPlanner planner({});
  planner.Reset(0);
  auto command = planner.ComputeCommand(ViewOf(map, path, 0.0));
  ASSERT_TRUE(command);
  EXPECT_NEAR(command->linear, 2.0 * 0.7 * kLargest * 0.75, 1e-9);  // 0.581 m/s
  EXPECT_NEAR(command->angular, 0.0, 1e-9);
  // The next bubble seen under atan(0.7 * 0.553 / distance) or less is driven to: 4 / s * angle.
  command = planner.ComputeCommand(ViewOf(map, path, -0.1));
  ASSERT_TRUE(command);
  EXPECT_NEAR(command->linear, 2.0 * 0.7 * kLargest * 0.75 * std::cos(0.1), 1e-9);
  EXPECT_NEAR(command->angular, 0.4, 1e-9);
  // Farther beside it, the robot turns on the spot, as fast as it may.
  command = planner.ComputeCommand(ViewOf(map, path, 2.0));
  ASSERT_TRUE(command);
  EXPECT_EQ(*command, (Twist{0.0, -1.0}));
}

TEST(ElasticBandPlanner, DrivesBlindWhereANewPathIsBlocked) {
  const Costmap map = MapOf(Line({1.5, -5.0}, {1.5, 4.99}, 401));
  const std::vector<base::Vec2> path = Line({0.0, 0.0}, {3.0, 0.0}, 121);
  ElasticBandPlanner planner({});
  planner.Reset(0);
  const auto command = planner.ComputeCommand(ViewOf(map, path, 0.0));
  ASSERT_TRUE(command);
  EXPECT_GT(command->linear, 0.5);
  LocalView old_path = ViewOf(map, path, 0.0);
  old_path.path_is_new = false;
  EXPECT_EQ(planner.ComputeCommand(old_path), std::nullopt) << "sees again";
}

}  // namespace
}  // namespace slalom::planners
