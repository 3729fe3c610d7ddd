#pragma once

#include <span>

#include "sim/collision_map.h"

/// Shortening the LiDAR's ranges to circles and boxes. Only the beams inside a shape's angular span
/// are tested, in vectors of eight. Frames: `W` the course's own, `S` the sensor (x ahead, y left).

namespace slalom::sim {

/// Padding after the last number of an array of beams, because vectors reach beyond the end.
inline constexpr int kBeamPadding = 16;

/// The sensor in W and its beams.
struct Sensor {
  float x, y, cos_yaw, sin_yaw;  // Pose of S in W, [m].
  float reach;                   // [m]
  float first_angle;             // [rad]
  float beams_per_radian;
  int num_beams;
  const float* beam_cos;  // [num_beams + kBeamPadding]
  const float* beam_sin;  // [num_beams + kBeamPadding]
};

/// Circles as arrays that can be read in whole vectors, [m].
struct Circles {
  const float *x, *y, *radius;
};

/// Shortens `ranges` [num_beams + kBeamPadding] [m] to the circles of all runs. The padding is
/// overwritten.
void CastCircles(const Circles& circles, std::span<const CollisionMap::Run> runs,
                 const Sensor& sensor, float* ranges);

/// Shortens `ranges` to the boxes in the same way.
void CastBoxes(std::span<const PlacedBox> boxes, const Sensor& sensor, float* ranges);

}  // namespace slalom::sim
