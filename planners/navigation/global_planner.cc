#include "planners/navigation/global_planner.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/check.h"

namespace slalom::planners {
namespace {

constexpr float kInfinite = std::numeric_limits<float>::infinity();
constexpr float kNeutralCost = 50.0f;  // Cost of crossing a free cell.
constexpr float kCostFactor = 0.8f;
constexpr double kPathStep = 0.5;  // [cells]
// Less than a free cell can cost per cell of a straight line: the approximation's error is 0.45 %
// at most, on a diagonal.
constexpr float kHeuristicCost = 0.99f * kNeutralCost;
// Less than a cell's potential is above its lowest neighbour's, so that cells are mostly updated
// once.
constexpr float kBucketWidth = 25.0f;
// If the goal was not reached, paths that cost this much more are searched next.
constexpr float kBoundGrowth = 1.2f;
// If a change is nearer than this share of the way, nearly everything lies behind it, and it is
// quicker to start from nothing.
constexpr float kWorthKeeping = 0.5f;
// Cells whose paths cost this much more than the best are settled too: the descent's gradients look
// up to two cells beside the path, where a cell costs 251 at most.
constexpr float kMargin = 1000.0f;

/// Cost of crossing a cell of each costmap value; infinite: a wall.
constexpr std::array<float, 256> kTraversalCosts = [] {
  std::array<float, 256> costs;
  costs.fill(kInfinite);
  for (int c = 0; c < kInscribedCost; ++c) {
    costs[c] = static_cast<float>(static_cast<int>(kNeutralCost + kCostFactor * c));
  }
  return costs;
}();

/// navfn's update of a cell that costs `crossing` from its lower neighbour in each direction. Its
/// quadratic exceeds 1 by 0.005 where only one neighbour counts in the end; cut off there, a cell's
/// potential does not depend on the order of updates.
float PlaneWave(float a, float b, float crossing) {
  const float low = std::min(a, b);
  const float difference = std::max(a, b) - low;
  if (!(difference < crossing)) return low + crossing;
  const float d = difference / crossing;
  return low + crossing * std::min(1.0f, -0.2301f * d * d + 0.5307f * d + 0.7040f);
}

}  // namespace

const std::vector<base::Vec2>& GlobalPlanner::Plan(const Costmap& costmap,
                                                   const CellWindow& changed, base::Vec2 start_O,
                                                   base::Vec2 goal_O) {
  const CellIndex robot = costmap.CellAt(start_O);
  const CellIndex goal = costmap.CellAt(goal_O);
  const auto at_edge = [&](CellIndex c) {
    return c.x < 1 || c.y < 1 || c.x > costmap.size_x() - 2 || c.y > costmap.size_y() - 2;
  };
  const bool blocked = !(goal == robot) && costmap.cost(goal) >= kInscribedCost;
  if (at_edge(robot) || at_edge(goal) || blocked) {
    valid_ = false;
    path_O_.clear();
    return path_O_;
  }
  if (!valid_ || costmap.size_x() != size_x_ || costmap.size_y() != size_y_) {
    Begin(costmap, robot, goal);
  } else if (!TakeIn(costmap, changed, robot, goal) && goal_O == goal_O_) {
    return path_O_;
  }
  goal_O_ = goal_O;
  Spread();
  if (potential_[Index(goal_)] < kInfinite && Descend(costmap)) {
    std::reverse(path_O_.begin(), path_O_.end());
    path_O_.push_back(goal_O);
  } else {
    path_O_.clear();
  }
  return path_O_;
}

void GlobalPlanner::Begin(const Costmap& costmap, CellIndex robot, CellIndex goal) {
  size_x_ = costmap.size_x();
  size_y_ = costmap.size_y();
  costs_.assign(costmap.costs().begin(), costmap.costs().end());
  for (int x = 0; x < size_x_; ++x) {
    costs_[Index({x, 0})] = costs_[Index({x, size_y_ - 1})] = kUnknownCost;
  }
  for (int y = 0; y < size_y_; ++y) {
    costs_[Index({0, y})] = costs_[Index({size_x_ - 1, y})] = kUnknownCost;
  }
  costs_[Index(robot)] = kFreeCost;  // Wherever the robot is, it is.
  potential_.assign(costs_.size(), kInfinite);
  pending_.assign(costs_.size(), 0);
  touched_.clear();
  const float dx = static_cast<float>(goal.x - robot.x), dy = static_cast<float>(goal.y - robot.y);
  bound_ = kNeutralCost * std::sqrt(dx * dx + dy * dy) + kMargin;
  StartAt(robot, goal);
  valid_ = true;
}

/// Takes in what changed. Returns whether a potential did.
bool GlobalPlanner::TakeIn(const Costmap& costmap, const CellWindow& changed, CellIndex robot,
                           CellIndex goal) {
  changed_.clear();
  lowest_changed_ = kInfinite;
  if (!(robot == robot_)) SetCost(Index(robot_), costmap.cost(robot_));
  for (int y = std::max(1, changed.y0); y < std::min(size_y_ - 1, changed.y1); ++y) {
    const int x0 = std::max(1, changed.x0), x1 = std::min(size_x_ - 1, changed.x1);
    if (x0 >= x1) break;
    const std::uint8_t* const now = costmap.costs().data() + costmap.Index({0, y});
    const std::uint8_t* const before = costs_.data() + costmap.Index({0, y});
    if (std::memcmp(now + x0, before + x0, static_cast<std::size_t>(x1 - x0)) == 0) continue;
    for (int x = x0; x < x1; ++x) {
      if (now[x] != before[x]) SetCost(Index({x, y}), now[x]);
    }
  }
  SetCost(Index(robot), kFreeCost);
  const float before = potential_[Index(goal_)];
  if (before < kInfinite) bound_ = before + kMargin;
  if (!(robot == robot_) || !(goal == goal_) || lowest_changed_ < kWorthKeeping * before) {
    StartAt(robot, goal);
    return true;
  }
  if (lowest_changed_ == kInfinite) return false;
  SpreadAnew();
  return true;
}

/// Forgets all potentials and queues the robot's cell.
void GlobalPlanner::StartAt(CellIndex robot, CellIndex goal) {
  for (const int n : touched_) potential_[n] = kInfinite;
  deferred_.clear();
  robot_ = robot;
  goal_ = goal;
  const int n = Index(robot);
  potential_[n] = 0.0f;
  touched_.assign(1, n);
  Push(n);
}

void GlobalPlanner::SetCost(int n, std::uint8_t cost) {
  if (costs_[n] == cost) return;
  costs_[n] = cost;
  changed_.push_back(n);
  // The cell's potential, before and after, is above its lowest neighbour's.
  lowest_changed_ = std::min({lowest_changed_, potential_[n], potential_[n - 1], potential_[n + 1],
                              potential_[n - size_x_], potential_[n + size_x_]});
}

/// Forgets the potentials that the change can matter to, and queues the cells that can restore
/// them.
void GlobalPlanner::SpreadAnew() {
  waiting_.swap(deferred_);
  deferred_.clear();
  std::size_t num_kept = 0;
  for (const int n : touched_) {
    if (potential_[n] <= lowest_changed_) {
      touched_[num_kept++] = n;
    } else {
      potential_[n] = kInfinite;
      changed_.push_back(n);
    }
  }
  touched_.resize(num_kept);
  for (const int n : waiting_) {
    if (potential_[n] < kInfinite) Push(n);
  }
  for (const int n : changed_) Relax(n);
}

void GlobalPlanner::Spread() {
  const int goal = Index(goal_);
  while (true) {
    for (; bucket_ < buckets_.size(); ++bucket_) {
      // The bucket grows while it is worked off.
      for (std::size_t i = 0; i < buckets_[bucket_].size(); ++i) {
        const int n = buckets_[bucket_][i];
        if (pending_[n] == 0) continue;  // Was worked off with a lower potential.
        pending_[n] = 0;
        // A plane wave is nowhere lower than the cells that it comes from.
        const float potential = potential_[n];
        for (const int m : {n - 1, n + 1, n - size_x_, n + size_x_}) {
          if (potential < potential_[m]) Relax(m);
        }
      }
      buckets_[bucket_].clear();
    }
    const float wanted =
        potential_[goal] < kInfinite ? potential_[goal] + kMargin : kBoundGrowth * bound_;
    if (deferred_.empty() || bound_ >= wanted) return;
    bound_ = wanted;
    waiting_.swap(deferred_);
    deferred_.clear();
    for (const int n : waiting_) Push(n);
  }
}

/// Lowers the potential of a cell to the value that its neighbours give it. Queues the cell if its
/// potential fell.
void GlobalPlanner::Relax(int n) {
  const float crossing = kTraversalCosts[costs_[n]];
  if (!(crossing < kInfinite)) return;
  const float potential =
      PlaneWave(std::min(potential_[n - 1], potential_[n + 1]),
                std::min(potential_[n - size_x_], potential_[n + size_x_]), crossing);
  if (!(potential < potential_[n])) return;
  if (potential_[n] == kInfinite) touched_.push_back(n);
  potential_[n] = potential;
  Push(n);
}

/// Returns a lower bound of the cost of a path to the goal over this cell.
float GlobalPlanner::Key(int n) const {
  const int y = n / size_x_, x = n - y * size_x_;
  const float dx = static_cast<float>(x - goal_.x), dy = static_cast<float>(y - goal_.y);
  return potential_[n] + kHeuristicCost * std::sqrt(dx * dx + dy * dy);
}

/// Queues a cell, to update its neighbours from its potential. Defers it if no wanted path leads
/// over it.
void GlobalPlanner::Push(int n) {
  if (extent_ == Extent::kPath && Key(n) > bound_) {
    deferred_.push_back(n);
    return;
  }
  const auto bucket = static_cast<std::size_t>(potential_[n] * (1.0f / kBucketWidth));
  if (bucket >= buckets_.size()) buckets_.resize(bucket + 1);
  bucket_ = std::min(bucket_, bucket);
  pending_[n] = 1;
  buckets_[bucket].push_back(n);
}

/// Writes the path from the goal down to the robot. Returns whether it arrives.
bool GlobalPlanner::Descend(const Costmap& costmap) {
  path_O_.clear();
  gradients_.fill({});
  // navfn takes the lower corner of a cell for its position (NavfnROS::mapToWorld).
  const auto position = [&](double x, double y) {
    return costmap.origin() + costmap.resolution() * base::Vec2{x, y};
  };
  const auto nearest_cell = [](double d) { return d >= 0.5 ? 1 : d <= -0.5 ? -1 : 0; };
  int n = Index(goal_);
  const int robot = Index(robot_);
  double dx = 0.0, dy = 0.0;  // Offset of the path's point from cell n's, [cells].
  const std::size_t max_points = 4 * static_cast<std::size_t>(std::max(size_x_, size_y_));
  while (path_O_.size() < max_points) {
    if (n + nearest_cell(dx) + size_x_ * nearest_cell(dy) == robot) {
      path_O_.push_back(position(robot_.x, robot_.y));
      return true;
    }
    const int y = n / size_x_, x = n - y * size_x_;
    if (x < 1 || y < 1 || x > size_x_ - 2 || y > size_y_ - 2) return false;
    path_O_.push_back(position(x + dx, y + dy));
    const auto num = path_O_.size();
    const bool turned_back = num > 2 && path_O_[num - 1] == path_O_[num - 3];

    int lowest = n;
    float lowest_potential = std::floor(potential_[n]);  // navfn compares with whole numbers here.
    bool at_boundary = false;
    for (int row = -1; row <= 1; ++row) {
      for (int column = -1; column <= 1; ++column) {
        const int m = n + row * size_x_ + column;
        if (potential_[m] == kInfinite) at_boundary = true;
        if (!(potential_[m] < lowest_potential)) continue;
        lowest = m;
        lowest_potential = std::floor(potential_[m]);
      }
    }
    // There is no gradient beside walls, and one that points to and fro does not help: go to the
    // lowest of the eight neighbours.
    if (at_boundary || turned_back) {
      if (lowest == n) return false;
      n = lowest;
      dx = dy = 0.0;
      continue;
    }
    const base::Vec2 g00 = GradientAt(n), g10 = GradientAt(n + 1);
    const base::Vec2 g01 = GradientAt(n + size_x_), g11 = GradientAt(n + size_x_ + 1);
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

/// Returns the direction in which the potential rises, of length 1, or 0 if it does not.
base::Vec2 GlobalPlanner::GradientAt(int n) {
  KnownGradient& known = gradients_[static_cast<std::size_t>(n) % gradients_.size()];
  if (known.cell == n) return known.direction;
  const double here = potential_[n];
  const auto slope = [&](int before, int after) {
    double d = 0.0;
    if (potential_[before] < kInfinite) d += potential_[before] - here;
    if (potential_[after] < kInfinite) d += here - potential_[after];
    return d;
  };
  const base::Vec2 g{slope(n - 1, n + 1), slope(n - size_x_, n + size_x_)};
  const double norm = base::Norm(g);
  known = {n, norm > 0.0 ? (1.0 / norm) * g : g};
  return known.direction;
}

}  // namespace slalom::planners
