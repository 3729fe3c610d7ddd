#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/geometry.h"
#include "planners/costmap.h"

namespace slalom::planners {

/// Plans over a costmap as navfn does: a potential spreads from the goal over the cells by a
/// quadratic approximation to a plane wave, a cell's own cost being 50 + 0.8 times its costmap
/// value, and a path descends the interpolated gradient in steps of half a cell. Cells of
/// kInscribedCost and above are walls, save the robot's own; so is the map's edge.
///
/// navfn spreads the potential from the robot over all that is nearer than the goal; here it
/// spreads from the goal, in the order of an A* search, until the cells that the path can touch are
/// settled, and stays while neither goal nor map change. Confined to one thread at a time.
class GlobalPlanner {
 public:
  /// How far the potential spreads: to what the path needs, or to all that can be reached (for
  /// tests; the paths are the same).
  enum class Extent { kPath, kEverywhere };

  explicit GlobalPlanner(Extent extent = Extent::kPath) : extent_(extent) {}

  /// Forgets the potential: the next plan starts from nothing.
  void Reset() { valid_ = false; }

  /// A path from `start_O` to `goal_O`, about two points per cell, from the middle of the robot's
  /// cell to the goal; empty where there is none. `map_changed`: since the last call; must be true
  /// if any cost or the map's place did. Cost: O(cells near the path), a few 0.1 ms over 10 m when
  /// the map changed.
  const std::vector<base::Vec2>& Plan(const Costmap& costmap, bool map_changed, base::Vec2 start_O,
                                      base::Vec2 goal_O);

  /// The potential of a cell as far as it has been spread; infinite elsewhere.
  float potential(CellIndex c) const {
    return potential_[static_cast<std::size_t>(c.y) * static_cast<std::size_t>(size_x_) +
                      static_cast<std::size_t>(c.x)];
  }

 private:
  void Begin(const Costmap& costmap, CellIndex start, CellIndex goal);
  bool Spread(const Costmap& costmap);
  void UpdateCell(const Costmap& costmap, int n);
  void Push(int n, float potential);
  float Traversal(const Costmap& costmap, int n) const;
  bool Descend(const Costmap& costmap);
  base::Vec2 Gradient(int n) const;

  const Extent extent_;
  bool valid_ = false;  // The potential is that of the costmap and goal_.
  int size_x_ = 0, size_y_ = 0;
  CellIndex start_, goal_;
  std::vector<float> potential_;       // [size_y, size_x]
  std::vector<int> touched_;           // Cells that have a potential.
  std::vector<std::uint8_t> pending_;  // [size_y, size_x], whether in a bucket.
  // Cells to update, by the least that a path over them can cost, in steps of kBucketWidth.
  std::vector<std::vector<int>> buckets_;
  std::size_t bucket_ = 0;
  float first_key_ = 0.0f;
  std::vector<base::Vec2> path_O_;
};

}  // namespace slalom::planners
