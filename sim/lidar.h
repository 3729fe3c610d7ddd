#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry.h"
#include "base/random.h"
#include "env/sensing/scan.h"
#include "sim/collision_map.h"
#include "sim/environment_config.h"
#include "sim/moving_obstacles.h"

/// Frames: `W` the course's own frame, `R` the robot, `S` the sensor (x ahead, y left).

namespace slalom::sim {

/// The longest range that only a beam with an echo reports, [m]. A beam without one reads
/// max_range plus noise, rounded.
double LongestEcho(const LidarConfig& config);

/// The scans of a task, as observations show them.
env::ScanGeometry ScanGeometryOf(const EnvironmentConfig& environment);

/// The range finder: casts planar scans against a `CollisionMap` and moving obstacles.
///
/// For each obstacle, only the beams inside its angular span are tested. Thread-compatible: one
/// instance may serve many threads as long as none configures it. Scans do not allocate.
class Lidar {
 public:
  /// `clip`: longer ranges are reported as this range, [m].
  Lidar(const LidarConfig& config, double clip);

  /// Makes this the `Lidar` of another config, and computes only what differs. Allocates nothing if
  /// the number of beams stays the same. Cost: about 10 us for another field of view, 2 us for each
  /// other noise.
  void Configure(const LidarConfig& config, double clip);

  /// Writes one scan, as the sensor reports it, taken with the robot at `X_WR`.
  ///
  /// `ranges_cm`: [num_beams] [cm], counter-clockwise. A beam that hits nothing has max_range.
  /// Noise and lost beams are drawn from `noise`; then ranges are raised to min_range, rounded to
  /// the resolution and clipped.
  /// `moving`: the moving obstacles at the time of the scan, or null if there are none.
  /// Requires: ranges_cm.size() == num_beams().
  /// Cost: about 1.6 us on the courses of the paper; O(num_beams + sum over obstacles in reach of
  /// the beams they span).
  void Scan(const CollisionMap& map, const base::Pose2& X_WR, base::Random& noise,
            std::span<std::uint16_t> ranges_cm, const MovingShapes* moving = nullptr) const;

  /// Writes the distances from the sensor to the nearest obstacle, before noise, rounding and clip.
  ///
  /// `ranges`: [num_beams] [m], counter-clockwise, exact to 1e-4 m unless a beam grazes an
  /// obstacle. They are 0 if the sensor is inside an obstacle. An obstacle so far away that neither
  /// clip nor noise lets it change a report counts as not hit and gives max_range.
  /// Requires: ranges.size() == num_beams().
  void Cast(const CollisionMap& map, const base::Pose2& X_WR, std::span<float> ranges,
            const MovingShapes* moving = nullptr) const;

  int num_beams() const { return config_.num_beams; }
  /// Place of the sensor in R, [m].
  base::Vec2 mounting() const { return {config_.offset_x, config_.offset_y}; }

  /// Direction of a beam in S, [rad].
  double beam_angle(int beam) const { return first_angle_ + beam * angle_step_; }

 private:
  void CastPadded(const CollisionMap& map, const MovingShapes* moving, const base::Pose2& X_WR,
                  float* ranges) const;
  void AddNoise(base::Random& noise, float* ranges) const;
  void DropBeams(base::Random& noise, float* ranges) const;

  LidarConfig config_;
  double clip_ = 0.0;                       // [m]
  double first_angle_ = 0.0;                // [rad]
  double angle_step_ = 0.0;                 // [rad]
  double reach_ = 0.0;                      // Obstacles beyond this cannot change a report, [m].
  std::vector<float> beam_cos_, beam_sin_;  // [num_beams + padding]
  std::vector<float> noise_quantiles_;      // [kNoiseLevels] [m]
  std::vector<float> relative_quantiles_;   // [kNoiseLevels], per metre of range.
};

}  // namespace slalom::sim
