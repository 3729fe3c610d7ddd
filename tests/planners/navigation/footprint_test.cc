#include "planners/navigation/footprint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random.h"
#include "tests/planners/random_maps.h"

namespace slalom::planners {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr int kWhole = 1 << 30;

std::vector<CellIndex> Line(CellIndex a, CellIndex b, int num_steps = kWhole) {
  std::vector<CellIndex> cells;
  VisitLine(a, b, num_steps, [&](CellIndex c) {
    cells.push_back(c);
    return true;
  });
  return cells;
}

TEST(VisitLine, KnownLines) {
  EXPECT_THAT(Line({2, 2}, {2, 2}), ElementsAre(CellIndex{2, 2}));
  EXPECT_THAT(Line({0, 0}, {3, 0}),
              ElementsAre(CellIndex{0, 0}, CellIndex{1, 0}, CellIndex{2, 0}, CellIndex{3, 0}));
  EXPECT_THAT(Line({0, 0}, {-2, -2}),
              ElementsAre(CellIndex{0, 0}, CellIndex{-1, -1}, CellIndex{-2, -2}));
  // Error starts at 4 / 2 and grows by 1 a step: across at the second step.
  EXPECT_THAT(Line({0, 0}, {1, 4}), ElementsAre(CellIndex{0, 0}, CellIndex{0, 1}, CellIndex{1, 2},
                                                CellIndex{1, 3}, CellIndex{1, 4}));
  EXPECT_THAT(Line({0, 0}, {9, 0}, 1), ElementsAre(CellIndex{0, 0}, CellIndex{1, 0}));
}

// Oracle: the closed form of Bresenham's rule.
TEST(VisitLine, FollowsTheClosedForm) {
  base::Random random(1);
  for (int trial = 0; trial < 500; ++trial) {
    const auto draw = [&] { return static_cast<int>(random.UniformInt(81)) - 40; };
    const CellIndex a{draw(), draw()}, b{draw(), draw()};
    const int dx = std::abs(b.x - a.x), dy = std::abs(b.y - a.y);
    const int longer = std::max(dx, dy), shorter = std::min(dx, dy);
    const std::vector<CellIndex> line = Line(a, b);
    ASSERT_EQ(line.size(), static_cast<std::size_t>(longer + 1));
    for (int i = 0; i <= longer; ++i) {
      const int across = longer == 0 ? 0 : (i * shorter + longer / 2) / longer;
      const int along_x = dx >= dy ? i : across, along_y = dx >= dy ? across : i;
      EXPECT_EQ(line[i].x, a.x + (b.x >= a.x ? along_x : -along_x));
      EXPECT_EQ(line[i].y, a.y + (b.y >= a.y ? along_y : -along_y));
    }
    EXPECT_EQ(line.back(), b);
  }
}

TEST(VisitLine, VisitsTheSameCellsOfAMap) {
  base::Random random(2);
  const Costmap map(30, 20, 0.05, {});
  for (int trial = 0; trial < 500; ++trial) {
    const auto draw = [&](int size) { return static_cast<int>(random.UniformInt(size)); };
    const CellIndex a{draw(30), draw(20)}, b{draw(30), draw(20)};
    std::vector<std::size_t> expected, indices;
    for (const CellIndex c : Line(a, b, 12)) expected.push_back(map.Index(c));
    VisitLineOn(map, a, b, 12, [&](int n) {
      indices.push_back(static_cast<std::size_t>(n));
      return true;
    });
    ASSERT_EQ(indices, expected);
  }
}

TEST(PaddedFootprint, IsPaddedOnEachSide) {
  const PaddedFootprint footprint{FootprintConfig{}};
  EXPECT_DOUBLE_EQ(footprint.half_length, 0.31);
  EXPECT_DOUBLE_EQ(footprint.half_width, 0.265);
  EXPECT_DOUBLE_EQ(footprint.inscribed_radius(), 0.265);
  EXPECT_DOUBLE_EQ(footprint.circumscribed_radius(), std::sqrt(0.31 * 0.31 + 0.265 * 0.265));
  const auto corners = footprint.Corners({{1.0, 2.0}, 0.5 * base::kPi});
  EXPECT_NEAR(corners[1].x, 1.265, 1e-12);  // Ahead is +y now, its right is +x.
  EXPECT_NEAR(corners[1].y, 2.31, 1e-12);
}

TEST(OutlineCost, SeesTheOutlineOnly) {
  const PaddedFootprint footprint{FootprintConfig{}};
  const base::Pose2 X_OR{{1.025, 1.025}, 0.0};  // In the middle of cell (20, 20).
  Costmap map(41, 41, 0.05, {});
  EXPECT_EQ(OutlineCost(map, footprint, X_OR), 0);
  map.set_cost({20, 20}, kLethalCost);  // Inside.
  EXPECT_EQ(OutlineCost(map, footprint, X_OR), 0);
  map.set_cost({26, 20}, 77);  // x = 1.335 lies in cell 26.
  EXPECT_EQ(OutlineCost(map, footprint, X_OR), 77);
  map.set_cost({20, 25}, kInscribedCost);  // y = 1.29 lies in cell 25.
  EXPECT_EQ(OutlineCost(map, footprint, X_OR), 253);
  map.set_cost({14, 20}, kLethalCost);
  EXPECT_EQ(OutlineCost(map, footprint, X_OR), -1);
  EXPECT_EQ(OutlineCost(map, footprint, {{0.2, 1.0}, 0.0}), -1) << "leaves the map";
}

// Oracle: points sampled densely on the edges. Bresenham's line keeps within a cell of the edge.
TEST(OutlineCost, AgreesWithSampledEdges) {
  const PaddedFootprint footprint{FootprintConfig{}};
  base::Random random(2);
  int num_hits = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Costmap map = DrawMap(40, 0.004, 0.0, 0.0, random);
    const base::Pose2 X_OR{{random.Uniform(0.5, 1.5), random.Uniform(0.5, 1.5)},
                           random.Uniform(-3.0, 3.0)};
    const auto corners = footprint.Corners(X_OR);
    bool on_edge = false, near_edge = false;
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k <= 1000; ++k) {
        const CellIndex c =
            map.CellAt(corners[i] + (k / 1000.0) * (corners[(i + 1) % 4] - corners[i]));
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            near_edge |= map.cost({c.x + dx, c.y + dy}) == kLethalCost;
          }
        }
      }
      on_edge |= map.cost(map.CellAt(corners[i])) == kLethalCost;
    }
    const bool hit = OutlineCost(map, footprint, X_OR) < 0;
    num_hits += hit;
    EXPECT_TRUE(hit || !on_edge);
    EXPECT_TRUE(!hit || near_edge);
  }
  EXPECT_GT(num_hits, 20);
  EXPECT_LT(num_hits, 200);
}

TEST(CoveredCells, AreTheRectangle) {
  const PaddedFootprint footprint{FootprintConfig{}};
  const Costmap map(60, 60, 0.05, {});
  base::Random random(3);
  std::vector<CellIndex> cells;
  for (int trial = 0; trial < 100; ++trial) {
    const base::Pose2 X_OR{{random.Uniform(0.6, 2.4), random.Uniform(0.6, 2.4)},
                           random.Uniform(-3.0, 3.0)};
    CoveredCells(map, footprint, X_OR, cells);
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 60; ++x) {
        const base::Vec2 p_R = base::InverseTransform(X_OR, map.CentreOf({x, y}));
        const double ahead = std::fabs(p_R.x) - footprint.half_length;
        const double aside = std::fabs(p_R.y) - footprint.half_width;
        const auto count = std::count(cells.begin(), cells.end(), CellIndex{x, y});
        // The outline's cells reach at most a cell's diagonal, 0.0707 m, beyond.
        const double outside = std::max(ahead, aside);
        EXPECT_TRUE(outside > -0.0708 || count == 1);
        EXPECT_TRUE(outside < 0.0708 || count == 0);
      }
    }
  }
  CoveredCells(map, footprint, {{0.1, 0.1}, 0.0}, cells);
  EXPECT_THAT(cells, IsEmpty());
}

}  // namespace
}  // namespace slalom::planners
