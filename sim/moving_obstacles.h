#pragma once

#include <vector>

#include "sim/collision_map.h"
#include "sim/courses/course.h"
#include "sim/courses/motion.h"

namespace slalom::sim {

/// A moving obstacle at one time.
struct MovingShape {
  PlacedBox box;          ///< Pose, and the size of a box.
  float radius = 0.0f;    ///< Radius of a cylinder, [m]; 0 for a box.
  float vx = 0.0f;        ///< Velocity of its origin in W, [m/s].
  float vy = 0.0f;        ///< [m/s]
  float yaw_rate = 0.0f;  ///< [rad/s]
};

/// Distance from the footprint to the obstacle, as `CollisionMap::Clearance` measures it, [m].
float Clearance(const MovingShape& shape, const Footprint& footprint, const FootprintPose& X_WR);

/// Moving obstacles at one time, laid out for the LiDAR. Circles are held in arrays, and kLanes
/// far-away circles follow the last one.
struct MovingShapes {
  std::vector<float> x, y, radius;  ///< [num_circles + kLanes] [m]
  std::vector<PlacedBox> boxes;
  int num_circles = 0;

  /// Makes room for `num_obstacles`, so that filling does not allocate.
  void Reserve(int num_obstacles);
};

/// The moving obstacles of a course, ready to be looked up at any motion time
/// (sim/courses/motion.h). Immutable.
class MovingObstacles {
 public:
  explicit MovingObstacles(const Course& course);

  int size() const { return static_cast<int>(obstacles_.size()); }
  bool empty() const { return obstacles_.empty(); }

  /// Obstacle `i` at motion time `time` [s].
  MovingShape At(int i, double time) const;

  /// Fills `shapes` with all obstacles at motion time `time` [s]. Allocates only if `shapes` never
  /// held as many.
  void PlaceAll(double time, MovingShapes& shapes) const;

  /// Radius of the smallest circle round B's origin that holds obstacle `i`, [m].
  float circumradius(int i) const { return obstacles_[i].circumradius; }
  /// Speed that B's origin of obstacle `i` never exceeds, apart from jumps, [m/s].
  float max_speed(int i) const { return obstacles_[i].max_speed; }
  /// Whether obstacle `i` may jump in (time, time + duration], both in [s].
  bool Jumps(int i, double time, double duration) const {
    return obstacles_[i].motion.BeginsRound(time, duration);
  }

  /// Whether any obstacle touches the footprint at motion time `time` [s].
  bool Touch(double time, const Footprint& footprint, const FootprintPose& X_WR) const;

 private:
  struct Obstacle {
    Motion motion;
    float radius, half_x, half_y;  // [m]
    float circumradius, max_speed;
  };

  std::vector<Obstacle> obstacles_;
};

}  // namespace slalom::sim
