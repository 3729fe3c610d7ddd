#pragma once

#include <memory>
#include <span>
#include <vector>

#include "sim/collision_map.h"
#include "sim/environment_config.h"
#include "sim/moving_obstacles.h"

class b2Body;
class b2World;

namespace slalom::sim {

/// Pose and velocity in W of a point of the body, which each use names, and the body's heading. A
/// value.
struct BodyState {
  float x = 0.0f;         ///< [m]
  float y = 0.0f;         ///< [m]
  float yaw = 0.0f;       ///< [rad]
  float vx = 0.0f;        ///< In W, [m/s].
  float vy = 0.0f;        ///< In W, [m/s].
  float yaw_rate = 0.0f;  ///< [rad/s]

  friend bool operator==(const BodyState&, const BodyState&) = default;
};

/// A Box2D world with the robot's body and, during a step, the obstacles that it may touch.
///
/// It keeps no memory of earlier steps: a step is a function of the body's state and the obstacles
/// alone, bit for bit. One instance therefore serves any number of environments. Confined to one
/// thread at a time. Allocates nothing once its pools have grown.
class ContactWorld {
 public:
  explicit ContactWorld(const RobotConfig& config);
  ~ContactWorld();
  ContactWorld(const ContactWorld&) = delete;
  ContactWorld& operator=(const ContactWorld&) = delete;

  /// Moves the body on by `dt` [s]. Contacts present at the start push it back, without bounce and
  /// with friction; otherwise it keeps its velocity. `state` is that of the centre of mass
  /// (sim/mass_distribution.h); the config says where the outline lies about it. `moving` holds the
  /// moving obstacles that the body may touch, as they are at the start of the step; they do not
  /// give way. Returns whether the body touched anything at the start. Cost: about 2 us.
  bool Step(const CollisionMap& map, std::span<const MovingShape> moving, float dt,
            BodyState& state);

 private:
  void PlaceObstacles(const CollisionMap& map, const BodyState& state);
  void PlaceMoving(std::span<const MovingShape> moving);
  void RemoveObstacles();
  bool Touching() const;

  const float
      reach_;  // Upper bound of the distance from the centre of mass to the outline's corners, [m].
  std::unique_ptr<b2World> world_;
  b2Body* robot_ = nullptr;      // Owned by world_.
  b2Body* obstacles_ = nullptr;  // The fixed obstacles. Owned by world_.
  std::vector<b2Body*> moving_;  // The moving obstacles during a step. Owned by world_.
};

/// The footprint of the configured robot.
Footprint MakeFootprint(const RobotConfig& config);

}  // namespace slalom::sim
