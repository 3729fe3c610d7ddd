#pragma once

#include <memory>
#include <span>
#include <vector>

#include "base/mutex.h"
#include "sim/collision_map.h"
#include "sim/environment_config.h"
#include "sim/moving_obstacles.h"
#include "sim/robot_body.h"

namespace slalom::sim {

/// Rigid-body steps of the robot while it touches something, computed by Box2D.
///
/// A step is a function of the body's state and the obstacles alone, bit for bit: nothing of
/// earlier steps is kept. So any number of robots share one instance. Thread-safe: there are as
/// many Box2D worlds as threads have stepped at the same time. Allocates nothing once these have
/// grown.
class ContactWorld {
 public:
  explicit ContactWorld(const RobotConfig& config);
  ~ContactWorld();
  ContactWorld(const ContactWorld&) = delete;
  ContactWorld& operator=(const ContactWorld&) = delete;

  /// Moves the body on by `dt` [s]. Contacts present at the start push it back, without bounce and
  /// with friction; otherwise it keeps its velocity. `state` is the state of the centre of mass
  /// (sim/mass_distribution.h); the config says where the outline lies about it. `moving` holds the
  /// moving obstacles that the body may touch, as they are at the start of the step; they do not
  /// give way. Returns whether the body touched anything at the start. Cost: about 2 us.
  bool Step(const CollisionMap& map, std::span<const MovingShape> moving, float dt,
            BodyState& state);

 private:
  class World;

  const RobotConfig config_;
  base::Mutex mutex_;
  std::vector<std::unique_ptr<World>> idle_ GUARDED_BY(mutex_);
};

/// The footprint of the configured robot.
Footprint MakeFootprint(const RobotConfig& config);

}  // namespace slalom::sim
