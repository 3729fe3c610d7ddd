#include "planners/global_planner.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/check.h"

namespace slalom::planners {
namespace {

constexpr float kInfinite = std::numeric_limits<float>::infinity();
constexpr float kNeutralCost = 50.0f;  // Of crossing a free cell.
constexpr float kCostFactor = 0.8f;
constexpr float kInverseSqrt2 = 0.70710678f;
constexpr double kPathStep = 0.5;  // [cells]
// Below what a free cell can cost per cell of straight line, the approximation's error included.
constexpr float kHeuristicCost = 0.95f * kNeutralCost;
constexpr float kBucketWidth = 25.0f;
// Cells whose paths cost this much more than the best are settled too: the descent's gradients look
// up to two cells beside the path, where a cell costs 251 at most.
constexpr float kMargin = 1000.0f;

/// Cost of crossing a cell of each costmap value; infinite: a wall.
const std::array<float, 256>& TraversalTable() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t;
    for (int c = 0; c < 256; ++c) {
      t[c] = c < kInscribedCost ? std::floor(kNeutralCost + kCostFactor * c) : kInfinite;
    }
    return t;
  }();
  return table;
}

/// navfn's update of a cell that costs `crossing` from its lower neighbour in each direction.
float PlaneWave(float a, float b, float crossing) {
  const float low = std::min(a, b);
  const float difference = std::max(a, b) - low;
  if (!(difference < crossing)) return low + crossing;
  const float d = difference / crossing;
  return low + crossing * (-0.2301f * d * d + 0.5307f * d + 0.7040f);
}

}  // namespace

const std::vector<base::Vec2>& GlobalPlanner::Plan(const Costmap& costmap, bool map_changed,
                                                   base::Vec2 start_O, base::Vec2 goal_O) {
  path_O_.clear();
  const CellIndex start = costmap.CellAt(start_O);
  const CellIndex goal = costmap.CellAt(goal_O);
  const auto off_the_map = [&](CellIndex c) {  // The edge is a wall.
    return c.x < 1 || c.y < 1 || c.x > costmap.size_x() - 2 || c.y > costmap.size_y() - 2;
  };
  if (off_the_map(start) || off_the_map(goal) || costmap.cost(goal) >= kInscribedCost) {
    valid_ = false;
    return path_O_;
  }
  const bool reusable = valid_ && !map_changed && goal == goal_;
  start_ = start;
  if (reusable && Descend(costmap)) {
    path_O_.push_back(goal_O);
    return path_O_;
  }
  Begin(costmap, start, goal);
  valid_ = Spread(costmap);
  if (valid_ && Descend(costmap)) {
    path_O_.push_back(goal_O);
  } else {
    path_O_.clear();
  }
  return path_O_;
}

void GlobalPlanner::Begin(const Costmap& costmap, CellIndex start, CellIndex goal) {
  start_ = start;
  goal_ = goal;
  if (costmap.size_x() != size_x_ || costmap.size_y() != size_y_) {
    size_x_ = costmap.size_x();
    size_y_ = costmap.size_y();
    potential_.assign(costmap.costs().size(), kInfinite);
    pending_.assign(costmap.costs().size(), 0);
  }
  for (const int n : touched_) potential_[n] = kInfinite;
  touched_.clear();
  for (auto& bucket : buckets_) {
    for (const int n : bucket) pending_[n] = 0;
    bucket.clear();
  }
  bucket_ = 0;
  const float dx = static_cast<float>(goal.x - start.x), dy = static_cast<float>(goal.y - start.y);
  first_key_ = std::max(0.0f, kHeuristicCost * (std::sqrt(dx * dx + dy * dy) - 2.0f));

  const int n = goal.y * size_x_ + goal.x;
  potential_[n] = 0.0f;
  touched_.push_back(n);
  for (const int neighbour : {n + 1, n - 1, n - size_x_, n + size_x_}) Push(neighbour, 0.0f);
}

bool GlobalPlanner::Spread(const Costmap& costmap) {
  const int start = start_.y * size_x_ + start_.x;
  for (; bucket_ < buckets_.size(); ++bucket_) {
    // The bucket grows while it is worked off.
    for (std::size_t i = 0; i < buckets_[bucket_].size(); ++i) {
      const int n = buckets_[bucket_][i];
      pending_[n] = 0;
      UpdateCell(costmap, n);
    }
    buckets_[bucket_].clear();
    const float key = first_key_ + kBucketWidth * static_cast<float>(bucket_ + 1);
    if (extent_ == Extent::kPath && key > potential_[start] + kMargin) break;
  }
  return potential_[start] < kInfinite;
}

void GlobalPlanner::UpdateCell(const Costmap& costmap, int n) {
  const float crossing = Traversal(costmap, n);
  if (!(crossing < kInfinite)) return;
  const float left = potential_[n - 1], right = potential_[n + 1];
  const float down = potential_[n - size_x_], up = potential_[n + size_x_];
  const float potential = PlaneWave(std::min(left, right), std::min(down, up), crossing);
  if (!(potential < potential_[n])) return;
  if (potential_[n] == kInfinite) touched_.push_back(n);
  potential_[n] = potential;
  // A neighbour can gain from this cell at most what two such neighbours would give it.
  const auto offer = [&](int m, float its_potential) {
    if (its_potential > potential + kInverseSqrt2 * Traversal(costmap, m)) Push(m, potential);
  };
  offer(n - 1, left);
  offer(n + 1, right);
  offer(n - size_x_, down);
  offer(n + size_x_, up);
}

void GlobalPlanner::Push(int n, float potential) {
  if (pending_[n] != 0) return;
  const int y = n / size_x_, x = n - y * size_x_;
  if (x < 1 || y < 1 || x > size_x_ - 2 || y > size_y_ - 2) return;
  const float dx = static_cast<float>(x - start_.x), dy = static_cast<float>(y - start_.y);
  const float key = potential + kHeuristicCost * std::sqrt(dx * dx + dy * dy);
  const auto wanted =
      static_cast<std::size_t>(std::max(0.0f, (key - first_key_) * (1.0f / kBucketWidth)));
  const std::size_t bucket = std::max(bucket_, wanted);
  if (bucket >= buckets_.size()) buckets_.resize(bucket + 1);
  pending_[n] = 1;
  buckets_[bucket].push_back(n);
}

float GlobalPlanner::Traversal(const Costmap& costmap, int n) const {
  if (n == start_.y * size_x_ + start_.x) return kNeutralCost;  // Wherever the robot is, it is.
  return TraversalTable()[costmap.costs()[n]];
}

bool GlobalPlanner::Descend(const Costmap& costmap) {
  path_O_.clear();
  int n = start_.y * size_x_ + start_.x;
  const int goal = goal_.y * size_x_ + goal_.x;
  double dx = 0.0, dy = 0.0;  // Of the path's point from the middle of cell n, [cells].
  const auto max_points = static_cast<std::size_t>(4 * std::max(size_x_, size_y_));
  while (path_O_.size() < max_points) {
    const int nearest =
        n + static_cast<int>(std::lround(dx)) + size_x_ * static_cast<int>(std::lround(dy));
    if (nearest == goal) return true;
    const int y = n / size_x_, x = n - y * size_x_;
    if (x < 2 || y < 2 || x > size_x_ - 3 || y > size_y_ - 3) return false;
    const base::Vec2 centre_O = costmap.CentreOf({x, y});
    path_O_.push_back(centre_O + costmap.resolution() * base::Vec2{dx, dy});

    int lowest = n;
    bool at_boundary = false;
    for (int row = -1; row <= 1; ++row) {
      for (int column = -1; column <= 1; ++column) {
        const int m = n + row * size_x_ + column;
        if (potential_[m] == kInfinite) at_boundary = true;
        if (potential_[m] < potential_[lowest]) lowest = m;
      }
    }
    if (at_boundary) {  // No gradient beside walls: to the lowest of the eight neighbours.
      if (lowest == n) return false;
      n = lowest;
      dx = dy = 0.0;
      continue;
    }
    const base::Vec2 g00 = Gradient(n), g10 = Gradient(n + 1);
    const base::Vec2 g01 = Gradient(n + size_x_), g11 = Gradient(n + size_x_ + 1);
    const base::Vec2 g =
        (1.0 - dy) * ((1.0 - dx) * g00 + dx * g10) + dy * ((1.0 - dx) * g01 + dx * g11);
    const double norm = base::Norm(g);
    if (norm == 0.0) return false;
    dx += kPathStep / norm * g.x;
    dy += kPathStep / norm * g.y;
    if (dx > 1.0) n += 1, dx -= 1.0;
    if (dx < -1.0) n -= 1, dx += 1.0;
    if (dy > 1.0) n += size_x_, dy -= 1.0;
    if (dy < -1.0) n -= size_x_, dy += 1.0;
  }
  return false;
}

base::Vec2 GlobalPlanner::Gradient(int n) const {
  const double here = potential_[n];
  const auto slope = [&](int before, int after) {
    double d = 0.0;
    if (potential_[before] < kInfinite) d += potential_[before] - here;
    if (potential_[after] < kInfinite) d += here - potential_[after];
    return d;
  };
  const base::Vec2 g{slope(n - 1, n + 1), slope(n - size_x_, n + size_x_)};
  const double norm = base::Norm(g);
  return norm > 0.0 ? (1.0 / norm) * g : g;
}

}  // namespace slalom::planners
