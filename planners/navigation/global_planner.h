#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/geometry.h"
#include "planners/navigation/costmap.h"

namespace slalom::planners {

/// Plans over a costmap as navfn does (ROS melodic, navfn/src/navfn.cpp and navfn_ros.cpp). A
/// potential spreads from the robot over the cells by a quadratic approximation to a plane wave;
/// crossing a cell costs 50 + 0.8 times its costmap value (`NavFn::updateCell`, `setCostmap`). The
/// path descends the interpolated gradient from the goal to the robot in steps of half a cell
/// (`NavFn::calcPath`) and is then turned round (`NavfnROS::getPlanFromPotential`). A cell stands
/// for its lower corner, not for its middle, so the path lies half a cell towards the map's origin
/// (`NavfnROS::mapToWorld`). Cells of kInscribedCost and above are walls, except the robot's own
/// (`NavfnROS::clearRobotCell`); so is the map's edge.
///
/// navfn spreads the potential over every cell nearer than the goal. Here it spreads, as in A*,
/// only over cells that the path can touch, judged by the straight distance left to the goal. While
/// the robot stays in its cell and the map changes beyond half of the way, only the potential
/// behind the change is computed again; if no potential changes, the path is kept. None of this
/// changes the path. Confined to one thread at a time.
class GlobalPlanner {
 public:
  /// How far the potential spreads: over the cells that the path needs, or, for tests, over all
  /// that can be reached. The paths are the same.
  enum class Extent { kPath, kEverywhere };

  explicit GlobalPlanner(Extent extent = Extent::kPath) : extent_(extent) {}

  /// Discards the potential, so that the next plan computes all of it.
  void Reset() { valid_ = false; }

  /// Returns a path from the lower corner of the cell of `start_O` to `goal_O`, about two points
  /// per cell, or an empty one if there is no way. `changed` must contain all cells whose cost
  /// changed since the last call, which must have been with the same map in the same place; the
  /// first call after `Reset` ignores it. Cost: O(cells near the path), a few 0.1 ms over 10 m;
  /// next to nothing if neither the robot's cell nor the map changed.
  const std::vector<base::Vec2>& Plan(const Costmap& costmap, const CellWindow& changed,
                                      base::Vec2 start_O, base::Vec2 goal_O);

  /// Returns the potential of a cell; infinite if the potential has not spread there.
  float potential(CellIndex c) const {
    return potential_[static_cast<std::size_t>(c.y) * static_cast<std::size_t>(size_x_) +
                      static_cast<std::size_t>(c.x)];
  }

 private:
  /// The gradient of a cell's potential that the descent knows already.
  struct KnownGradient {
    int cell = -1;
    base::Vec2 direction;
  };

  void Begin(const Costmap& costmap, CellIndex robot, CellIndex goal);
  bool TakeIn(const Costmap& costmap, const CellWindow& changed, CellIndex robot, CellIndex goal);
  void StartAt(CellIndex robot, CellIndex goal);
  void SetCost(int n, std::uint8_t cost);
  void SpreadAnew();
  void Spread();
  void Relax(int n);
  void Push(int n);
  float Key(int n) const;
  bool Descend(const Costmap& costmap);
  base::Vec2 GradientAt(int n);
  int Index(CellIndex c) const { return c.y * size_x_ + c.x; }

  const Extent extent_;
  bool valid_ = false;  // The potential belongs to costs_, robot_ and goal_.
  int size_x_ = 0, size_y_ = 0;
  CellIndex robot_, goal_;
  std::vector<std::uint8_t> costs_;  // [size_y, size_x], the edge unknown, the robot's cell free.
  std::vector<float> potential_;     // [size_y, size_x]
  std::vector<int> touched_;         // Cells that have a potential.
  // Cells whose potential fell, by potential in steps of kBucketWidth; a cell may be in several.
  std::vector<std::vector<int>> buckets_;
  std::vector<std::uint8_t> pending_;  // [size_y, size_x], whether its neighbours must be updated.
  std::size_t bucket_ = 0;             // All buckets before this one are empty.
  std::vector<int> deferred_;          // Cells whose potential fell, with paths beyond bound_.
  float bound_ = 0.0f;                 // Cost of the most expensive paths that are considered.
  // The change being handled: its cells, and the potential below which it affects no cell.
  std::vector<int> changed_, waiting_;
  float lowest_changed_ = 0.0f;
  std::array<KnownGradient, 64> gradients_;
  base::Vec2 goal_O_;  // The path's.
  std::vector<base::Vec2> path_O_;
};

}  // namespace slalom::planners
