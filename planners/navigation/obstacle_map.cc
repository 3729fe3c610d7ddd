#include "planners/navigation/obstacle_map.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <span>
#include <utility>

namespace slalom::planners {
namespace {

base::Vec2 OriginFor(const ObstacleMapConfig& config, base::Vec2 centre_O) {
  const double half = 0.5 * config.num_cells * config.resolution;
  return centre_O - base::Vec2{half, half};
}

/// Costs are brought up to date by squares of this many cells.
constexpr int kTile = 16;

/// Moves a square grid over the ground by (dx, dy) cells: its cells move the other way. New cells
/// are free.
void Shift(int size, int dx, int dy, std::span<std::uint8_t> cells) {
  const int x0 = std::max(0, dx), x1 = std::min(size, size + dx);  // Stay on the map.
  const auto row = [&](int y) { return cells.data() + static_cast<std::ptrdiff_t>(y) * size; };
  for (int i = 0; i < size; ++i) {
    const int to = dy >= 0 ? i : size - 1 - i;  // No row is written before it was read.
    const int from = to + dy;
    if (x0 >= x1 || from < 0 || from >= size) {
      std::memset(row(to), kFreeCost, static_cast<std::size_t>(size));
      continue;
    }
    std::memmove(row(to) + x0 - dx, row(from) + x0, static_cast<std::size_t>(x1 - x0));
    std::memset(row(to), kFreeCost, static_cast<std::size_t>(x0 - dx));
    std::memset(row(to) + x1 - dx, kFreeCost, static_cast<std::size_t>(size - (x1 - dx)));
  }
}

/// The cells of a row whose costs are wrong after a move by `d` cells: [0, first) and
/// [second, size).
std::pair<int, int> WrongEnds(int size, int d, int reach) {
  if (d == 0) return {0, size};
  const int first = std::min(size, d > 0 ? reach : -d);
  return {first, std::max(first, size - (d > 0 ? d : reach))};
}

}  // namespace

ObstacleMap::ObstacleMap(const ObstacleMapConfig& config, const PaddedFootprint& footprint)
    : config_(config),
      footprint_(footprint),
      inflation_(config.resolution, footprint.inscribed_radius(), config.inflation_radius,
                 config.cost_scaling),
      costmap_(config.num_cells, config.num_cells, config.resolution, OriginFor(config, {})),
      obstacles_(costmap_.costs().size(), kFreeCost) {}

void ObstacleMap::Reset(base::Vec2 centre_O) {
  costmap_.set_origin(OriginFor(config_, centre_O));
  std::fill(obstacles_.begin(), obstacles_.end(), kFreeCost);
  std::fill(costmap_.mutable_costs().begin(), costmap_.mutable_costs().end(), kFreeCost);
  stale_ = false;
}

CellWindow ObstacleMap::Update(const env::ScanRays& scan, const base::Pose2& X_OR) {
  const bool moved = config_.rolling && RollTo(X_OR.p);
  const double radius = config_.raytrace_range + footprint_.circumscribed_radius() +
                        base::Norm(scan.sensor_O - X_OR.p) + 2.0 * config_.resolution;
  const CellWindow window = WindowAround(X_OR.p, radius);
  const auto width = static_cast<std::size_t>(std::max(0, window.x1 - window.x0));
  before_.resize(width * static_cast<std::size_t>(std::max(0, window.y1 - window.y0)));
  for (int y = window.y0; y < window.y1; ++y) {
    std::memcpy(before_.data() + width * (y - window.y0),
                obstacles_.data() + costmap_.Index({window.x0, y}), width);
  }
  Take(scan, X_OR);
  if (stale_) {
    inflation_.Apply(obstacles_, WholeMap(), costmap_);
    stale_ = false;
    return WholeMap();
  }
  const CellWindow changed = InflateChanges(window);
  return moved ? WholeMap() : changed;
}

void ObstacleMap::Mark(const env::ScanRays& scan, const base::Pose2& X_OR) {
  stale_ = true;
  if (config_.rolling) RollTo(X_OR.p);
  Take(scan, X_OR);
}

void ObstacleMap::Take(const env::ScanRays& scan, const base::Pose2& X_OR) {
  if (!config_.marks_stay) Trace(scan);
  CoveredCells(costmap_, footprint_, X_OR, under_robot_);
  for (const CellIndex c : under_robot_) obstacles_[costmap_.Index(c)] = kFreeCost;
  if (config_.marks_stay) Trace(scan);
}

CellWindow ObstacleMap::ClearOutside(base::Vec2 p_O, double side) {
  const CellIndex low = costmap_.CellAt(p_O - base::Vec2{0.5 * side, 0.5 * side});
  const CellIndex high = costmap_.CellAt(p_O + base::Vec2{0.5 * side, 0.5 * side});
  bool cleared = false;
  for (int y = 0; y < costmap_.size_y(); ++y) {
    for (int x = 0; x < costmap_.size_x(); ++x) {
      std::uint8_t& cell = obstacles_[costmap_.Index({x, y})];
      const bool inside = x > low.x && x < high.x && y > low.y && y < high.y;
      if (inside || cell == kFreeCost) continue;
      cell = kFreeCost;
      cleared = true;
    }
  }
  if (!cleared) return {};
  inflation_.Apply(obstacles_, WholeMap(), costmap_);
  stale_ = false;
  return WholeMap();
}

bool ObstacleMap::RollTo(base::Vec2 centre_O) {
  const base::Vec2 origin = costmap_.origin();
  const base::Vec2 wanted = OriginFor(config_, centre_O);
  // As costmap_2d's updateOrigin: by whole cells, rounded towards zero.
  const int dx = static_cast<int>((wanted.x - origin.x) / config_.resolution);
  const int dy = static_cast<int>((wanted.y - origin.y) / config_.resolution);
  if (dx == 0 && dy == 0) return false;
  const int size = config_.num_cells;
  costmap_.set_origin({origin.x + dx * config_.resolution, origin.y + dy * config_.resolution});
  Shift(size, dx, dy, obstacles_);
  if (stale_) return true;
  Shift(size, dx, dy, costmap_.mutable_costs());
  // Costs are wrong in cells that are new, and near those that left.
  const int reach = inflation_.reach();
  const auto [left, right] = WrongEnds(size, dx, reach);
  const auto [bottom, top] = WrongEnds(size, dy, reach);
  inflation_.Apply(obstacles_, {0, 0, left, size}, costmap_);
  inflation_.Apply(obstacles_, {right, 0, size, size}, costmap_);
  inflation_.Apply(obstacles_, {left, 0, right, bottom}, costmap_);
  inflation_.Apply(obstacles_, {left, top, right, size}, costmap_);
  return true;
}

void ObstacleMap::Trace(const env::ScanRays& scan) {
  const CellIndex sensor = costmap_.CellAt(scan.sensor_O);
  if (!costmap_.Contains(sensor)) return;
  const int reach = static_cast<int>(std::ceil(config_.raytrace_range / config_.resolution));
  const bool all_inside = sensor.x >= reach && sensor.y >= reach &&
                          sensor.x + reach < costmap_.size_x() &&
                          sensor.y + reach < costmap_.size_y();
  std::uint8_t* const cells = obstacles_.data();
  marks_.clear();
  CellIndex last_end{-1, -1};
  for (const env::ScanRay& ray : scan.rays) {
    if (!ray.hit) continue;
    const CellIndex end = costmap_.CellAt(ray.p_O);
    const bool marks = base::Norm(ray.p_O - scan.sensor_O) < config_.obstacle_range;
    if (marks && costmap_.Contains(end)) marks_.push_back(costmap_.Index(end));
    if (end == last_end) continue;  // The same line once more.
    last_end = end;
    const int dx = std::abs(end.x - sensor.x), dy = std::abs(end.y - sensor.y);
    const double length = std::sqrt(static_cast<double>(dx) * dx + static_cast<double>(dy) * dy);
    const double share = length > reach ? reach / length : 1.0;
    const int num_steps = static_cast<int>(share * std::max(dx, dy));
    if (all_inside) {
      VisitLineOn(costmap_, sensor, end, num_steps, [&](int n) {
        cells[n] = kFreeCost;
        return true;
      });
    } else {
      VisitLine(sensor, end, num_steps, [&](CellIndex c) {
        if (!costmap_.Contains(c)) return false;
        cells[costmap_.Index(c)] = kFreeCost;
        return true;
      });
    }
  }
  for (const std::size_t i : marks_) cells[i] = kLethalCost;
}

CellWindow ObstacleMap::WindowAround(base::Vec2 p_O, double radius) const {
  const CellIndex low = costmap_.CellAt(p_O - base::Vec2{radius, radius});
  const CellIndex high = costmap_.CellAt(p_O + base::Vec2{radius, radius});
  return {std::clamp(low.x, 0, costmap_.size_x()), std::clamp(low.y, 0, costmap_.size_y()),
          std::clamp(high.x + 1, 0, costmap_.size_x()),
          std::clamp(high.y + 1, 0, costmap_.size_y())};
}

/// Brings the costs up to date with the obstacles of `window`, which were `before_`.
CellWindow ObstacleMap::InflateChanges(const CellWindow& window) {
  const int reach = inflation_.reach();
  const int size = config_.num_cells, num_tiles = (size + kTile - 1) / kTile;
  changed_tiles_.assign(static_cast<std::size_t>(num_tiles) * num_tiles, 0);
  const int width = window.x1 - window.x0;
  for (int y = window.y0; y < window.y1; ++y) {
    const std::uint8_t* const before =
        before_.data() + static_cast<std::size_t>(width) * (y - window.y0);
    const std::uint8_t* const now = obstacles_.data() + costmap_.Index({window.x0, y});
    if (std::memcmp(before, now, static_cast<std::size_t>(width)) == 0) continue;
    const int y0 = std::max(0, y - reach) / kTile, y1 = std::min(size - 1, y + reach) / kTile;
    for (int i = 0; i < width; ++i) {
      if (before[i] == now[i]) continue;
      const int x = window.x0 + i;
      const int x0 = std::max(0, x - reach) / kTile, x1 = std::min(size - 1, x + reach) / kTile;
      for (int tile_y = y0; tile_y <= y1; ++tile_y) {
        std::fill_n(changed_tiles_.begin() + tile_y * num_tiles + x0, x1 - x0 + 1, 1);
      }
    }
  }
  CellWindow written;
  for (int tile_y = 0; tile_y < num_tiles; ++tile_y) {
    const std::uint8_t* const tiles = changed_tiles_.data() + tile_y * num_tiles;
    for (int begin = 0; begin < num_tiles; ++begin) {
      if (tiles[begin] == 0) continue;
      int end = begin + 1;
      while (end < num_tiles && tiles[end] != 0) ++end;
      const CellWindow run{kTile * begin, kTile * tile_y, std::min(size, kTile * end),
                           std::min(size, kTile * (tile_y + 1))};
      inflation_.Apply(obstacles_, run, costmap_);
      written = Union(written, run);
      begin = end;
    }
  }
  return written;
}

}  // namespace slalom::planners
