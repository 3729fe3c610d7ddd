#pragma once

#include <array>
#include <cstdlib>
#include <vector>

#include "base/config_field.h"
#include "base/geometry.h"
#include "planners/navigation/costmap.h"

/// Frames: `O` odometry, `R` the robot.

namespace slalom::planners {

/// The robot's outline as a navigation system assumes it (docs/original-system.md, section 8.2).
struct FootprintConfig {
  double length = 0.42;
  double width = 0.33;
  double padding = 0.1;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("length", length, base::Range{0.05, 2.0}, "m", "Outline along the driving direction.");
    v("width", width, base::Range{0.05, 2.0}, "m", "Outline across the driving direction.");
    v("padding", padding, base::Range{0.0, 1.0}, "m", "Added to the outline on each side.");
  }
};

/// The padded outline, by default a rectangle of 0.62 x 0.53 m. A value.
struct PaddedFootprint {
  double half_length = 0.0;  ///< [m]
  double half_width = 0.0;   ///< [m]

  explicit PaddedFootprint(const FootprintConfig& config);

  /// Radius of the largest circle round the centre that fits inside, [m].
  double inscribed_radius() const { return half_length < half_width ? half_length : half_width; }
  /// Radius of the smallest circle round the centre that contains the outline, [m].
  double circumscribed_radius() const;
  /// Returns the corners in O with the robot at X_OR, counter-clockwise.
  std::array<base::Vec2, 4> Corners(const base::Pose2& X_OR) const {
    return Corners(X_OR.p, base::SinCos(X_OR.yaw));
  }
  std::array<base::Vec2, 4> Corners(base::Vec2 p_O, base::SinCosResult heading) const;
};

/// Walks the line from `a` to `b` by Bresenham's algorithm, up to `num_steps` steps along the
/// longer axis, that is over at most num_steps + 1 cells. `place` is where `a` is, in any terms of
/// the caller's; a step along x or y towards `b` adds `step_x` or `step_y` to it. `visit(place)`
/// returns whether to continue.
template <class Place, class Visitor>
void WalkLine(CellIndex a, CellIndex b, int num_steps, Place place, Place step_x, Place step_y,
              Visitor&& visit) {
  const int dx = std::abs(b.x - a.x), dy = std::abs(b.y - a.y);
  const bool along_x = dx >= dy;
  const int longer = along_x ? dx : dy, shorter = along_x ? dy : dx;
  const Place along = along_x ? step_x : step_y, across = along_x ? step_y : step_x;
  int error = longer / 2;
  for (int left = longer < num_steps ? longer : num_steps; visit(place) && left > 0; --left) {
    error += shorter;
    place = place + along;
    if (error >= longer) {
      error -= longer;
      place = place + across;
    }
  }
}

/// Visits the cells of a line as `WalkLine` does, by `visit(cell)`.
template <class Visitor>
void VisitLine(CellIndex a, CellIndex b, int num_steps, Visitor&& visit) {
  WalkLine(a, b, num_steps, a, {b.x >= a.x ? 1 : -1, 0}, {0, b.y >= a.y ? 1 : -1}, visit);
}

/// The same for a line that is wholly on `map`, by `visit(map.Index(cell))`.
template <class Visitor>
void VisitLineOn(const Costmap& map, CellIndex a, CellIndex b, int num_steps, Visitor&& visit) {
  const int stride = map.size_x();
  WalkLine(a, b, num_steps, a.y * stride + a.x, b.x >= a.x ? 1 : -1, b.y >= a.y ? stride : -stride,
           visit);
}

/// Returns the highest cost under the outline of the robot at X_OR, or -1 if the outline hits a
/// lethal or unknown cell or leaves the map. As in ROS's `CostmapModel`, cells inside the outline
/// do not count. Cost: one look-up per cell of the outline, about 46 by default.
int OutlineCost(const Costmap& costmap, const PaddedFootprint& footprint, base::Vec2 p_O,
                base::SinCosResult heading);
inline int OutlineCost(const Costmap& costmap, const PaddedFootprint& footprint,
                       const base::Pose2& X_OR) {
  return OutlineCost(costmap, footprint, X_OR.p, base::SinCos(X_OR.yaw));
}

/// Replaces `cells` by the cells under the robot, outline and inside. There are none if the outline
/// leaves the map.
void CoveredCells(const Costmap& costmap, const PaddedFootprint& footprint, const base::Pose2& X_OR,
                  std::vector<CellIndex>& cells);

}  // namespace slalom::planners
