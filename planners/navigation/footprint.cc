#include "planners/navigation/footprint.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace slalom::planners {
namespace {

constexpr int kWholeLine = std::numeric_limits<int>::max();

/// Returns the cells of the corners; none if a corner is off the map.
std::optional<std::array<CellIndex, 4>> CornerCells(const Costmap& costmap,
                                                    const std::array<base::Vec2, 4>& corners) {
  std::array<CellIndex, 4> cells;
  for (std::size_t i = 0; i < 4; ++i) {
    cells[i] = costmap.CellAt(corners[i]);
    if (!costmap.Contains(cells[i])) return std::nullopt;
  }
  return cells;
}

}  // namespace

PaddedFootprint::PaddedFootprint(const FootprintConfig& config)
    : half_length(0.5 * config.length + config.padding),
      half_width(0.5 * config.width + config.padding) {}

double PaddedFootprint::circumscribed_radius() const {
  return base::Norm({half_length, half_width});
}

std::array<base::Vec2, 4> PaddedFootprint::Corners(base::Vec2 p_O,
                                                   base::SinCosResult heading) const {
  const auto [s, c] = heading;
  const base::Vec2 ahead = half_length * base::Vec2{c, s};
  const base::Vec2 left = half_width * base::Vec2{-s, c};
  return {p_O - ahead - left, p_O + ahead - left, p_O + ahead + left, p_O - ahead + left};
}

int OutlineCost(const Costmap& costmap, const PaddedFootprint& footprint, base::Vec2 p_O,
                base::SinCosResult heading) {
  const auto corners = CornerCells(costmap, footprint.Corners(p_O, heading));
  if (!corners) return -1;
  const std::uint8_t* const costs = costmap.costs().data();
  int highest = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    VisitLineOn(costmap, (*corners)[i], (*corners)[(i + 1) % 4], kWholeLine, [&](int n) {
      highest = std::max<int>(highest, costs[n]);
      return highest < kLethalCost;
    });
    if (highest >= kLethalCost) return -1;
  }
  return highest;
}

void CoveredCells(const Costmap& costmap, const PaddedFootprint& footprint, const base::Pose2& X_OR,
                  std::vector<CellIndex>& cells) {
  cells.clear();
  const auto corners = CornerCells(costmap, footprint.Corners(X_OR));
  if (!corners) return;
  int left = (*corners)[0].x, right = left;
  for (const CellIndex c : *corners) {
    left = std::min(left, c.x);
    right = std::max(right, c.x);
  }
  struct Column {
    int bottom = std::numeric_limits<int>::max();
    int top = std::numeric_limits<int>::min();
  };
  std::vector<Column> columns(static_cast<std::size_t>(right - left + 1));
  for (std::size_t i = 0; i < 4; ++i) {
    VisitLine((*corners)[i], (*corners)[(i + 1) % 4], kWholeLine, [&](CellIndex c) {
      Column& column = columns[static_cast<std::size_t>(c.x - left)];
      column.bottom = std::min(column.bottom, c.y);
      column.top = std::max(column.top, c.y);
      return true;
    });
  }
  for (int x = left; x <= right; ++x) {
    const Column& column = columns[static_cast<std::size_t>(x - left)];
    for (int y = column.bottom; y <= column.top; ++y) cells.push_back({x, y});
  }
}

}  // namespace slalom::planners
