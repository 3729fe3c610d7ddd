#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry.h"

/// Frames: `O` odometry (fixed to the ground), `R` the robot.

namespace slalom::planners {

/// Special values of a cell, as in ROS's costmap_2d.
inline constexpr std::uint8_t kFreeCost = 0;
inline constexpr std::uint8_t kInscribedCost = 253;  ///< A robot centred here certainly collides.
inline constexpr std::uint8_t kLethalCost = 254;     ///< An obstacle.
inline constexpr std::uint8_t kUnknownCost = 255;

struct CellIndex {
  int x = 0;
  int y = 0;

  friend constexpr CellIndex operator+(CellIndex a, CellIndex b) { return {a.x + b.x, a.y + b.y}; }
  friend bool operator==(const CellIndex&, const CellIndex&) = default;
};

/// A rectangle of cells: [x0, x1) x [y0, y1). A value.
struct CellWindow {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;

  bool empty() const { return x0 >= x1 || y0 >= y1; }
};

/// Returns the smallest window that contains both.
inline CellWindow Union(const CellWindow& a, const CellWindow& b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  return {a.x0 < b.x0 ? a.x0 : b.x0, a.y0 < b.y0 ? a.y0 : b.y0, a.x1 > b.x1 ? a.x1 : b.x1,
          a.y1 > b.y1 ? a.y1 : b.y1};
}

/// A grid of costs over a part of O. A value.
///
/// Cell (x, y) covers [origin + resolution * (x, y), origin + resolution * (x + 1, y + 1)).
class Costmap {
 public:
  /// Makes a map of free cells. Requires: size_x, size_y >= 1, resolution > 0.
  Costmap(int size_x, int size_y, double resolution, base::Vec2 origin_O);

  int size_x() const { return size_x_; }
  int size_y() const { return size_y_; }
  double resolution() const { return resolution_; }  ///< [m]
  base::Vec2 origin() const { return origin_O_; }    ///< Corner of cell (0, 0), [m].
  /// Moves the grid over the ground. Cells keep their costs.
  void set_origin(base::Vec2 origin_O) { origin_O_ = origin_O; }

  bool Contains(CellIndex c) const {
    return c.x >= 0 && c.y >= 0 && c.x < size_x_ && c.y < size_y_;
  }
  /// Returns the cell that contains the point. It may lie outside the grid.
  CellIndex CellAt(base::Vec2 p_O) const {
    return {static_cast<int>(std::floor((p_O.x - origin_O_.x) / resolution_)),
            static_cast<int>(std::floor((p_O.y - origin_O_.y) / resolution_))};
  }
  /// Centre of a cell, [m].
  base::Vec2 CentreOf(CellIndex c) const;

  /// Requires: Contains(c).
  std::uint8_t cost(CellIndex c) const { return costs_[Index(c)]; }
  void set_cost(CellIndex c, std::uint8_t cost) { costs_[Index(c)] = cost; }

  /// [size_y, size_x], row by row.
  std::span<const std::uint8_t> costs() const { return costs_; }
  std::span<std::uint8_t> mutable_costs() { return costs_; }

  std::size_t Index(CellIndex c) const {
    return static_cast<std::size_t>(c.y) * static_cast<std::size_t>(size_x_) +
           static_cast<std::size_t>(c.x);
  }

 private:
  int size_x_, size_y_;
  double resolution_;
  base::Vec2 origin_O_;
  std::vector<std::uint8_t> costs_;
};

}  // namespace slalom::planners
