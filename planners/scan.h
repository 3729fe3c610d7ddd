#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry.h"

/// Frames: `O` odometry, `R` the robot, `S` the sensor. Shapes: `N` beams.

namespace slalom::planners {

/// How the scans that a navigation system reads were taken. A value.
struct ScanGeometry {
  int num_beams = 720;
  double field_of_view = 4.71238;  ///< From the first beam to the last, centred on R's x, [rad].
  base::Vec2 p_RS{0.12, 0.0};      ///< Place of the sensor, [m]; its x is R's.
  double clip = 5.0;               ///< Ranges at or beyond this hit nothing, [m].
};

/// A beam in O: where it ends, and whether at an obstacle.
struct ScanRay {
  base::Vec2 p_O;
  bool hit = false;
};

/// A scan in O.
struct ScanRays {
  base::Vec2 sensor_O;
  std::vector<ScanRay> rays;  ///< [N], counter-clockwise.
};

/// Turns scans into rays. Immutable.
class ScanProjector {
 public:
  explicit ScanProjector(const ScanGeometry& geometry);

  /// The scan `ranges_cm` [N] [cm], taken with the robot at X_OR.
  /// Requires: ranges_cm.size() == num_beams.
  void Project(std::span<const std::uint16_t> ranges_cm, const base::Pose2& X_OR,
               ScanRays& out) const;

 private:
  const ScanGeometry geometry_;
  std::vector<base::Vec2> directions_R_;  // [N], of length 1.
};

}  // namespace slalom::planners
