#include "planners/navigation/obstacle_map.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/check.h"

namespace slalom::planners {
namespace {

base::Vec2 OriginFor(const ObstacleMapConfig& config, base::Vec2 centre_O) {
  const double half = 0.5 * config.num_cells * config.resolution;
  return centre_O - base::Vec2{half, half};
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

CellWindow ObstacleMap::Update(const ScanRays& scan, const base::Pose2& X_OR) {
  if (config_.rolling) RollTo(X_OR.p);
  const double radius = config_.raytrace_range + footprint_.circumscribed_radius() +
                        base::Norm(scan.sensor_O - X_OR.p) + 2.0 * config_.resolution;
  const CellWindow window = WindowAround(X_OR.p, radius);
  const auto width = static_cast<std::size_t>(std::max(0, window.x1 - window.x0));
  before_.resize(width * static_cast<std::size_t>(std::max(0, window.y1 - window.y0)));
  const auto row = [&](int y) {
    return obstacles_.data() + static_cast<std::size_t>(y) * costmap_.size_x() + window.x0;
  };
  for (int y = window.y0; y < window.y1; ++y) {
    std::memcpy(before_.data() + width * (y - window.y0), row(y), width);
  }

  Take(scan, X_OR);
  bool changed = stale_;
  for (int y = window.y0; y < window.y1 && !changed; ++y) {
    changed = std::memcmp(before_.data() + width * (y - window.y0), row(y), width) != 0;
  }
  if (!changed) return {};
  return Write(stale_ ? WholeMap() : window);
}

void ObstacleMap::Mark(const ScanRays& scan, const base::Pose2& X_OR) {
  if (config_.rolling) RollTo(X_OR.p);
  Take(scan, X_OR);
  stale_ = true;
}

void ObstacleMap::Take(const ScanRays& scan, const base::Pose2& X_OR) {
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
  return cleared ? Write(WholeMap()) : CellWindow{};
}

void ObstacleMap::RollTo(base::Vec2 centre_O) {
  const base::Vec2 origin = costmap_.origin();
  const base::Vec2 wanted = OriginFor(config_, centre_O);
  // As costmap_2d's updateOrigin: by whole cells, rounded towards zero.
  const int dx = static_cast<int>((wanted.x - origin.x) / config_.resolution);
  const int dy = static_cast<int>((wanted.y - origin.y) / config_.resolution);
  if (dx == 0 && dy == 0) return;
  const int size = config_.num_cells;
  std::vector<std::uint8_t> moved(obstacles_.size(), kFreeCost);
  const int x0 = std::max(0, dx), x1 = std::min(size, size + dx);
  for (int y = std::max(0, dy); y < std::min(size, size + dy) && x0 < x1; ++y) {
    std::memcpy(moved.data() + static_cast<std::size_t>(y - dy) * size + (x0 - dx),
                obstacles_.data() + static_cast<std::size_t>(y) * size + x0,
                static_cast<std::size_t>(x1 - x0));
  }
  obstacles_.swap(moved);
  costmap_.set_origin({origin.x + dx * config_.resolution, origin.y + dy * config_.resolution});
  stale_ = true;
}

void ObstacleMap::Trace(const ScanRays& scan) {
  const CellIndex sensor = costmap_.CellAt(scan.sensor_O);
  if (!costmap_.Contains(sensor)) return;
  const int reach = static_cast<int>(std::ceil(config_.raytrace_range / config_.resolution));
  const bool all_inside = sensor.x >= reach && sensor.y >= reach &&
                          sensor.x + reach < costmap_.size_x() &&
                          sensor.y + reach < costmap_.size_y();
  std::uint8_t* const cells = obstacles_.data();
  marks_.clear();
  CellIndex last_end{-1, -1};
  for (const ScanRay& ray : scan.rays) {
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

CellWindow ObstacleMap::Write(CellWindow window) {
  const int reach = inflation_.reach();
  window = {std::max(0, window.x0 - reach), std::max(0, window.y0 - reach),
            std::min(costmap_.size_x(), window.x1 + reach),
            std::min(costmap_.size_y(), window.y1 + reach)};
  inflation_.Apply(obstacles_, window, costmap_);
  stale_ = false;
  return window;
}

}  // namespace slalom::planners
