#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/geometry.h"
#include "planners/navigation/costmap.h"

/// The distance of a robot's outline from obstacles, fast enough for thousands of poses per cycle.
/// Frames: `O` odometry, `L` a frame with the axes of O at a point of the caller's choice.

namespace slalom::planners {

/// Distances to the nearest lethal cell, between cell centres, up to a maximum.
///
/// Thread-compatible. `Update` allocates only if the costmap is larger than any before.
class ClearanceMap {
 public:
  /// Requires: max_distance > 0 [m].
  explicit ClearanceMap(double max_distance);

  /// Reads the lethal cells of `costmap`. Later queries are in L, whose origin is `p_OL` in O.
  /// Cost: O(cells + lethal cells * (max_distance / resolution)^2), about 0.05 ms for 200 x 200
  /// cells, some hundreds of them lethal, and 0.6 m.
  void Update(const Costmap& costmap, base::Vec2 p_OL);

  /// Returns the distance [m] of the cell that holds (x, y) in L, or `max_distance()` if that is
  /// smaller or the point is off the map.
  float At(float x, float y) const {
    const float column = (x - origin_x_) * cells_per_metre_;
    const float row = (y - origin_y_) * cells_per_metre_;
    // In this form, NaN counts as off the map.
    if (!(column >= 0.0f && row >= 0.0f && column < width_ && row < height_)) return max_distance_;
    const int cell = static_cast<int>(row) * size_x_ + static_cast<int>(column);
    return distances_[static_cast<std::size_t>(cell)];
  }

  float max_distance() const { return max_distance_; }
  float resolution() const { return resolution_; }  ///< Resolution of the last costmap, [m].

 private:
  void MakeStamp();
  void Stamp(CellIndex lethal);

  const float max_distance_;
  float origin_x_ = 0.0f, origin_y_ = 0.0f;  // Corner of cell (0, 0) in L, [m].
  float resolution_ = 1.0f;                  // [m]
  float cells_per_metre_ = 1.0f;
  float width_ = 0.0f, height_ = 0.0f;  // [cells]
  int size_x_ = 0;
  int size_y_ = 0;
  int reach_ = 0;                 // max_distance, rounded up, [cells].
  std::vector<float> stamp_;      // [2 reach + 1, 2 reach + 1] around a lethal cell, [m].
  std::vector<float> distances_;  // [size_y, size_x], [m].
};

/// A rectangle centred on the robot, covered by discs: the inscribed circle in the middle and eight
/// equal discs around it, on a grid of 3 x 3.
///
/// The discs protrude over the edges (3 cm on a Jackal), so an obstacle point inside the rectangle
/// is always inside the cover. Immutable.
class DiscOutline {
 public:
  static constexpr int kNumDiscs = 8;

  /// Requires: length > 0 (along x), width > 0, [m].
  DiscOutline(double length, double width);

  float inscribed_radius() const { return inscribed_radius_; }          ///< [m]
  float circumscribed_radius() const { return circumscribed_radius_; }  ///< Discs included, [m].

  /// Returns the distance [m] from the discs, placed at (x, y) with heading (cosine, sine), to the
  /// nearest obstacle of `map`; negative if they overlap. At most `map.max_distance()`.
  float Clearance(const ClearanceMap& map, float x, float y, float cosine, float sine) const {
    float nearest = map.At(x, y) - inscribed_radius_;
    for (const Disc& disc : discs_) {
      nearest = std::min(nearest, map.At(x + cosine * disc.x - sine * disc.y,
                                         y + sine * disc.x + cosine * disc.y) -
                                      disc_radius_);
    }
    return nearest;
  }

 private:
  struct Disc {
    float x, y;  // Centre, [m].
  };

  float inscribed_radius_, circumscribed_radius_, disc_radius_;
  std::array<Disc, kNumDiscs> discs_;
};

}  // namespace slalom::planners
