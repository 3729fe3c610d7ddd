#include "planners/navigation/clearance_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/random.h"

namespace slalom::planners {
namespace {

Costmap RandomCostmap(base::Random& random, int size_x, int size_y, double share_lethal) {
  Costmap costmap(size_x, size_y, 0.05, {random.Uniform(-9.0, 9.0), random.Uniform(-9.0, 9.0)});
  for (std::uint8_t& cost : costmap.mutable_costs()) {
    cost = random.Uniform() < share_lethal ? kLethalCost
           : random.Uniform() < 0.5        ? kInscribedCost
                                           : 0;
  }
  return costmap;
}

/// Centre to centre, over all lethal cells.
double BruteForce(const Costmap& costmap, CellIndex from, double max_distance) {
  double nearest = max_distance;
  for (int y = 0; y < costmap.size_y(); ++y) {
    for (int x = 0; x < costmap.size_x(); ++x) {
      if (costmap.cost({x, y}) != kLethalCost) continue;
      nearest = std::min(nearest, costmap.resolution() * std::hypot(x - from.x, y - from.y));
    }
  }
  return nearest;
}

TEST(ClearanceMap, IsTheDistanceToTheNearestLethalCell) {
  base::Random random(1);
  ClearanceMap map(0.6);
  for (const double share : {0.0, 0.002, 0.02, 0.3, 1.0}) {
    const Costmap costmap = RandomCostmap(random, 37, 53, share);
    const base::Vec2 p_OL{random.Uniform(-9.0, 9.0), random.Uniform(-9.0, 9.0)};
    map.Update(costmap, p_OL);
    for (int y = 0; y < costmap.size_y(); ++y) {
      for (int x = 0; x < costmap.size_x(); ++x) {
        // Anywhere in the cell, but for a rounding error's breadth at its edge.
        const base::Vec2 p_O = costmap.CentreOf({x, y}) + base::Vec2{random.Uniform(-0.024, 0.024),
                                                                     random.Uniform(-0.024, 0.024)};
        EXPECT_NEAR(map.At(static_cast<float>(p_O.x - p_OL.x), static_cast<float>(p_O.y - p_OL.y)),
                    BruteForce(costmap, {x, y}, 0.6), 1e-6);
      }
    }
  }
}

TEST(ClearanceMap, IsFarOffTheMapAndForWhatIsNoNumber) {
  Costmap costmap(10, 10, 0.05, {0.0, 0.0});
  for (std::uint8_t& cost : costmap.mutable_costs()) cost = kLethalCost;
  ClearanceMap map(0.6);
  map.Update(costmap, {0.0, 0.0});
  EXPECT_EQ(map.At(0.49f, 0.01f), 0.0f);
  EXPECT_EQ(map.At(0.51f, 0.01f), 0.6f);
  EXPECT_EQ(map.At(-0.01f, 0.01f), 0.6f);
  EXPECT_EQ(map.At(0.01f, 1e9f), 0.6f);
  EXPECT_EQ(map.At(std::numeric_limits<float>::quiet_NaN(), 0.01f), 0.6f);
}

/// Signed distance of a point to a rectangle centred on the origin.
double DistanceToRectangle(base::Vec2 p, double length, double width) {
  const double dx = std::abs(p.x) - 0.5 * length, dy = std::abs(p.y) - 0.5 * width;
  return std::hypot(std::max(dx, 0.0), std::max(dy, 0.0)) + std::min(std::max(dx, dy), 0.0);
}

TEST(DiscOutline, CoversTheRectangleAndLittleMore) {
  const double length = 0.458, width = 0.416;
  const DiscOutline outline(length, width);
  ClearanceMap map(1.0);
  base::Random random(2);
  const double overhang =
      0.0334;  // sqrt(0.458^2 + 0.416^2) / 6 - 0.416 / 6 = 0.0338 - rounding up.
  for (int i = 0; i < 3000; ++i) {
    Costmap costmap(41, 41, 0.05, {-1.025, -1.025});
    const CellIndex lethal{static_cast<int>(random.UniformInt(41)),
                           static_cast<int>(random.UniformInt(41))};
    costmap.set_cost(lethal, kLethalCost);
    map.Update(costmap, {0.0, 0.0});
    const base::Pose2 X_LR{{random.Uniform(-0.3, 0.3), random.Uniform(-0.3, 0.3)},
                           random.Uniform(-3.0, 3.0)};
    const auto [s, c] = base::SinCos(X_LR.yaw);
    const double clearance =
        outline.Clearance(map, static_cast<float>(X_LR.p.x), static_cast<float>(X_LR.p.y),
                          static_cast<float>(c), static_cast<float>(s));
    const double exact =
        DistanceToRectangle(base::InverseTransform(X_LR, costmap.CentreOf(lethal)), length, width);
    if (exact > 0.6) continue;
    // A disc's centre is up to half a diagonal, 0.0354 m, off its cell's centre.
    if (exact > 0.0) {
      EXPECT_LE(clearance, exact + 0.0354 + 1e-5);
    } else {
      EXPECT_LE(clearance, 0.0354 + 1e-5);
    }
    EXPECT_GE(clearance, exact - overhang - 0.0354 - 1e-3);
  }
}

TEST(DiscOutline, KnowsItsRadii) {
  const DiscOutline outline(0.6, 0.3);
  EXPECT_FLOAT_EQ(outline.inscribed_radius(), 0.15f);
  // Corner discs at (0.2, 0.1), radius sqrt(0.2^2 + 0.1^2) / 2.
  EXPECT_FLOAT_EQ(outline.circumscribed_radius(), 1.5f * std::sqrt(0.05f));
}

}  // namespace
}  // namespace slalom::planners
