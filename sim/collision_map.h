#pragma once

#include <array>
#include <span>
#include <vector>

#include "base/geometry.h"
#include "sim/courses/course.h"

/// Frames: `W` the course's own frame, `R` the robot, `B` a box.

namespace slalom::sim {

/// The robot's rectangle, centred on its origin.
struct Footprint {
  float half_length = 0.0f;  ///< Along R's x, [m].
  float half_width = 0.0f;   ///< Along R's y, [m].

  /// From the centre to a corner, [m].
  float Circumradius() const {
    return std::sqrt(half_length * half_length + half_width * half_width);
  }
};

/// A box with its heading as cosine and sine.
struct PlacedBox {
  float x = 0.0f;  ///< Centre in W, [m].
  float y = 0.0f;
  float cos_yaw = 1.0f;
  float sin_yaw = 0.0f;
  float half_x = 0.0f;  ///< Along B's axes, [m].
  float half_y = 0.0f;
  float yaw = 0.0f;  ///< [rad]

  float Circumradius() const { return std::sqrt(half_x * half_x + half_y * half_y); }
};

/// The robot's pose with its heading as cosine and sine.
struct FootprintPose {
  float x = 0.0f;  ///< In W, [m].
  float y = 0.0f;
  float cos_yaw = 1.0f;
  float sin_yaw = 0.0f;
};

FootprintPose MakeFootprintPose(float x, float y, float yaw);

/// Distance from the footprint to a circle at (x, y), [m]. It is negative if they overlap.
float CircleClearance(float x, float y, float radius, const Footprint& footprint,
                      const FootprintPose& X_WR);

/// Distance from the footprint to a box along the axis that separates them most, [m]. It never
/// exceeds the real distance and has the same sign: negative if they overlap.
float BoxClearance(const PlacedBox& box, const Footprint& footprint, const FootprintPose& X_WR);

/// The fixed obstacles of a course, laid out for the LiDAR and the collision test. Circles are held
/// in arrays sorted by cell (row by row), so that a neighbourhood is a few contiguous runs. Boxes,
/// which are few, are held in a list.
///
/// Coordinates have single precision: they are exact to 1e-6 m within 16 m of the course's origin.
/// Immutable after construction; later calls do not allocate.
class CollisionMap {
 public:
  static constexpr int kMaxRows = 128;

  /// The circles [begin, end) of the arrays.
  struct Run {
    int begin = 0;
    int end = 0;
  };
  /// A neighbourhood, as runs in ascending order.
  struct Runs {
    std::array<Run, kMaxRows> runs;
    int size = 0;

    std::span<const Run> span() const { return std::span(runs).first(size); }
  };

  explicit CollisionMap(const Course& course);

  /// Finds all circles that come within `reach` [m] of the point (x, y), and possibly some others.
  void FindCircles(float x, float y, float reach, Runs& found) const;

  /// Distance from the footprint at a pose (or x, y [m], yaw [rad]) to the nearest obstacle, [m],
  /// at most `limit`. It never exceeds the real distance, and it is positive if and only if nothing
  /// is touched. The distance to a circle is exact; that to a box is exact beside its edges and may
  /// be too small at its corners.
  ///
  /// Requires: limit > 0.
  float Clearance(const Footprint& footprint, const FootprintPose& X_WR, float limit) const;
  float Clearance(const Footprint& footprint, float x, float y, float yaw, float limit) const {
    return Clearance(footprint, MakeFootprintPose(x, y, yaw), limit);
  }

  int num_circles() const { return num_circles_; }
  /// Arrays of the circles' centres and radii, [num_circles], [m]. kLanes far-away circles follow,
  /// so that a run may be read in whole vectors.
  const float* x() const { return x_.data(); }
  const float* y() const { return y_.data(); }
  const float* radius() const { return radius_.data(); }

  const std::vector<PlacedBox>& boxes() const { return boxes_; }

 private:
  int Row(float y) const;
  int Column(float x) const;

  int num_circles_ = 0;
  std::vector<float> x_, y_, radius_;
  std::vector<PlacedBox> boxes_;
  float max_radius_ = 0.0f;
  float min_x_ = 0.0f;
  float min_y_ = 0.0f;
  float inverse_cell_ = 1.0f;  // [1/m]
  int rows_ = 1;
  int columns_ = 1;
  std::vector<int> cell_begin_;  // [rows_ * columns_ + 1]
};

}  // namespace slalom::sim
