#include "planners/teb/homotopy.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace slalom::planners {
namespace {

/// Searches depth-first all paths through a roadmap without dead ends whose edges only lead
/// forwards.
class RoadmapSearch {
 public:
  RoadmapSearch(const std::vector<base::Vec2>& nodes, const std::vector<std::vector<int>>& edges,
                int max_paths, const std::function<bool(std::span<const base::Vec2>)>& visit)
      : nodes_(nodes), edges_(edges), num_left_(max_paths), visit_(visit) {}

  /// False: the search is over.
  bool From(int node) {
    way_.push_back(nodes_[node]);
    bool go_on = true;
    if (node == static_cast<int>(nodes_.size()) - 1) {
      go_on = visit_(way_) && --num_left_ > 0;
    } else {
      for (std::size_t i = 0; i < edges_[node].size() && go_on; ++i) go_on = From(edges_[node][i]);
    }
    way_.pop_back();
    return go_on;
  }

 private:
  const std::vector<base::Vec2>& nodes_;
  const std::vector<std::vector<int>>& edges_;
  int num_left_;
  const std::function<bool(std::span<const base::Vec2>)>& visit_;
  std::vector<base::Vec2> way_;
};

bool IsClear(const ClearanceMap& clearance, base::Vec2 from, base::Vec2 to, double min_clearance) {
  const base::Vec2 d = to - from;
  const int num_steps =
      std::max(1, static_cast<int>(std::ceil(base::Norm(d) / clearance.resolution())));
  for (int i = 0; i <= num_steps; ++i) {
    const base::Vec2 p = from + (static_cast<double>(i) / num_steps) * d;
    if (clearance.At(static_cast<float>(p.x), static_cast<float>(p.y)) < min_clearance) {
      return false;
    }
  }
  return true;
}

}  // namespace

std::span<const base::Vec2> ObstacleGroups::Find(const Costmap& costmap, base::Vec2 p_O,
                                                 double reach, double gap) {
  is_open_.assign(costmap.costs().size(), 0);
  std::vector<CellIndex> cells;
  for (int y = 0; y < costmap.size_y(); ++y) {
    for (int x = 0; x < costmap.size_x(); ++x) {
      if (costmap.cost({x, y}) != kLethalCost) continue;
      if (base::Norm(costmap.CentreOf({x, y}) - p_O) >= reach) continue;
      is_open_[costmap.Index({x, y})] = 1;
      cells.push_back({x, y});
    }
  }
  const double gap_cells = gap / costmap.resolution();
  const int radius = static_cast<int>(gap_cells);
  points_O_.clear();
  for (const CellIndex seed : cells) {
    if (!is_open_[costmap.Index(seed)]) continue;
    points_O_.push_back(costmap.CentreOf(seed));
    is_open_[costmap.Index(seed)] = 0;
    wave_.assign(1, seed);
    for (std::size_t i = 0; i < wave_.size(); ++i) {
      const CellIndex c = wave_[i];
      for (int dy = -radius; dy <= radius; ++dy) {
        for (int dx = -radius; dx <= radius; ++dx) {
          const CellIndex other{c.x + dx, c.y + dy};
          if (dx * dx + dy * dy > gap_cells * gap_cells || !costmap.Contains(other)) continue;
          char& is_open = is_open_[costmap.Index(other)];
          if (!is_open) continue;
          is_open = 0;
          wave_.push_back(other);
        }
      }
    }
  }
  return points_O_;
}

HomotopyClass ClassOf(std::span<const base::Vec2> path, std::span<const base::Vec2> points) {
  HomotopyClass angles(points.size(), 0.0);
  for (std::size_t k = 0; k < points.size(); ++k) {
    for (std::size_t i = 0; i + 1 < path.size(); ++i) {
      const base::Vec2 from = path[i] - points[k], to = path[i + 1] - points[k];
      angles[k] += std::atan2(base::Cross(from, to), base::Dot(from, to));
    }
  }
  return angles;
}

bool SameClass(const HomotopyClass& a, const HomotopyClass& b) {
  SLALOM_CHECK_EQ(a.size(), b.size());
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (std::abs(a[k] - b[k]) > base::kPi) return false;
  }
  return true;
}

void SearchRoadmap(const RoadmapConfig& config, base::Vec2 start, base::Vec2 goal,
                   const ClearanceMap& clearance, base::Random& random,
                   const std::function<bool(std::span<const base::Vec2>)>& visit) {
  const base::Vec2 d = goal - start;
  const double distance = base::Norm(d);
  if (distance == 0.0) return;
  const base::Vec2 along = (1.0 / distance) * d, across{-along.y, along.x};
  std::vector<base::Vec2> nodes = {start};
  for (int i = 0; i < config.num_samples; ++i) {
    const double forward = random.Uniform(0.0, distance);
    const double sideways = random.Uniform(-0.5 * config.width, 0.5 * config.width);
    nodes.push_back(start + forward * along + sideways * across);
  }
  std::sort(nodes.begin() + 1, nodes.end(), [&](base::Vec2 a, base::Vec2 b) {
    return base::Dot(a - start, along) < base::Dot(b - start, along);
  });
  nodes.push_back(goal);
  std::vector<std::vector<int>> edges(nodes.size());
  // From the goal back, so that it is known of each node which ones behind it lead there.
  for (int i = static_cast<int>(nodes.size()) - 2; i >= 0; --i) {
    for (int j = i + 1; j < static_cast<int>(nodes.size()); ++j) {
      const bool is_dead_end = j + 1 < static_cast<int>(nodes.size()) && edges[j].empty();
      const base::Vec2 edge = nodes[j] - nodes[i];
      if (is_dead_end || base::Dot(edge, along) <= config.heading_threshold * base::Norm(edge) ||
          !IsClear(clearance, nodes[i], nodes[j], config.min_clearance)) {
        continue;
      }
      edges[i].push_back(j);
    }
  }
  if (edges[0].empty()) return;
  RoadmapSearch(nodes, edges, config.max_paths, visit).From(0);
}

}  // namespace slalom::planners
