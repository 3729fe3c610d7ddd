#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry.h"

/// Frames: `O` odometry, `R` the robot, `S` the sensor. Shapes: `N` beams.

namespace slalom::env {

/// The geometry of the scans that a navigation system reads. A value.
struct ScanGeometry {
  int num_beams = 720;
  double field_of_view = 4.71238;  ///< From the first beam to the last, centred on R's x, [rad].
  base::Vec2 p_RS{0.12, 0.0};      ///< Position of the sensor, [m]; its axes are parallel to R's.
  double clip = 5.0;               ///< Beams with this range or more have no echo, [m].
};

/// The directions of the beams in R, of length 1, [N]. Requires: num_beams >= 2.
std::vector<base::Vec2> BeamDirections(const ScanGeometry& geometry);

/// A beam in O: its end, and whether it hit an obstacle there.
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

  /// Writes the rays of the scan `ranges_cm` [N] [cm], taken with the robot at X_OR, to `out`.
  /// Requires: ranges_cm.size() == num_beams.
  void Project(std::span<const std::uint16_t> ranges_cm, const base::Pose2& X_OR,
               ScanRays& out) const;

 private:
  const ScanGeometry geometry_;
  const std::vector<base::Vec2> directions_R_;  // [N]
};

}  // namespace slalom::env
