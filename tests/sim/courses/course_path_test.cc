#include "sim/courses/course_path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <tuple>
#include <vector>

#include "base/random.h"

namespace slalom::sim {
namespace {

constexpr double kNever = 1e18;

double NearnessCost(const FieldGrid& blocked, Cell cell) {
  double best = 3.0;
  for (int row = 0; row < kFieldSize; ++row) {
    for (int col = 0; col < kFieldSize; ++col) {
      if (blocked.filled({row, col}))
        best = std::min(best, std::hypot(row - cell.row, col - cell.col));
    }
  }
  return best <= 2.0 ? 5.0 / best : 0.0;
}

/// Cost of the cheapest way, kNever where there is none, by relaxing all moves until nothing
/// changes.
double CheapestCost(const FieldGrid& blocked, Cell entry, Cell exit) {
  std::map<std::tuple<int, int, int, int>, double> costs;  // (row, col, last move's row and col)
  costs[{entry.row, entry.col, 0, 0}] = 0.0;
  for (bool changed = true; changed;) {
    changed = false;
    const auto known = costs;
    for (const auto& [state, cost] : known) {
      const auto [row, col, last_row, last_col] = state;
      for (int r = -1; r <= 1; ++r) {
        for (int c = -1; c <= 1; ++c) {
          const Cell to{row + r, col + c};
          if ((r == 0 && c == 0) || !IsInField(to) || blocked.filled(to)) continue;
          // 45 degrees: the cosine of the turn is at least cos 45 - a rounding.
          const bool is_first = last_row == 0 && last_col == 0;
          const double cosine =
              (r * last_row + c * last_col) / (std::hypot(r, c) * std::hypot(last_row, last_col));
          if (!is_first && cosine < 0.7) continue;
          if (r != 0 && c != 0 && blocked.filled({row + r, col}) && blocked.filled({row, col + c}))
            continue;
          const double next = cost + std::hypot(r, c) + NearnessCost(blocked, to);
          const auto [found, is_new] = costs.try_emplace({to.row, to.col, r, c}, kNever);
          if (next < found->second - 1e-12) {
            found->second = next;
            changed = true;
          }
        }
      }
    }
  }
  double best = kNever;
  for (const auto& [state, cost] : costs) {
    if (std::get<0>(state) == exit.row && std::get<1>(state) == exit.col)
      best = std::min(best, cost);
  }
  return best;
}

double CostOf(const FieldGrid& blocked, const std::vector<Cell>& path) {
  double cost = 0.0;
  for (std::size_t i = 1; i < path.size(); ++i) {
    cost += std::hypot(path[i].row - path[i - 1].row, path[i].col - path[i - 1].col) +
            NearnessCost(blocked, path[i]);
  }
  return cost;
}

/// A field whose cells beyond a window of `size` are all blocked, so that the oracle stays quick.
FieldGrid DrawWindow(int size, double fill, base::Random& random) {
  FieldGrid blocked;
  for (int row = 0; row < kFieldSize; ++row) {
    for (int col = 0; col < kFieldSize; ++col) {
      const bool is_inside = row < size && col < size;
      blocked.set_filled({row, col}, !is_inside || random.Uniform() < fill);
    }
  }
  return blocked;
}

TEST(CoursePath, IsTheCheapestOfAll) {
  base::Random random(11);
  int num_ways = 0;
  int num_none = 0;
  for (int i = 0; i < 60; ++i) {
    FieldGrid blocked = DrawWindow(8, 0.3, random);
    const Cell entry{static_cast<int>(random.UniformInt(8)), 0};
    const Cell exit{static_cast<int>(random.UniformInt(8)), 7};
    blocked.set_filled(entry, false);
    blocked.set_filled(exit, false);
    const double cheapest = CheapestCost(blocked, entry, exit);
    const auto path = FindPath(blocked, entry, exit);
    ASSERT_EQ(path.has_value(), cheapest < kNever) << "draw " << i;
    if (!path) {
      ++num_none;
      continue;
    }
    ++num_ways;
    EXPECT_EQ(path->front(), entry);
    EXPECT_EQ(path->back(), exit);
    EXPECT_NEAR(CostOf(blocked, *path), cheapest, 1e-9) << "draw " << i;
  }
  // Both cases were seen.
  EXPECT_GT(num_ways, 10);
  EXPECT_GT(num_none, 10);
}

TEST(CoursePath, KeepsAwayFromObstaclesWhereThereIsRoom) {
  FieldGrid blocked;
  blocked.set_filled({10, 15}, true);
  const auto path = FindPath(blocked, {10, 0}, {10, 29});
  ASSERT_TRUE(path);
  for (const Cell& cell : *path) EXPECT_GT(std::hypot(cell.row - 10, cell.col - 15), 2.0);
}

TEST(CoursePath, OfOneCellIsThatCell) {
  EXPECT_EQ(FindPath(FieldGrid(), {4, 4}, {4, 4}), (std::vector<Cell>{{4, 4}}));
}

}  // namespace
}  // namespace slalom::sim
