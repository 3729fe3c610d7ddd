#pragma once

#include <array>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "base/geometry.h"
#include "sim/engines/jackal/jackal.h"
#include "sim/moving_obstacles.h"
#include "sim/robot_body.h"
#include "sim/skid_steering.h"

namespace slalom::engines {

/// Largest number of obstacles that `World::Step` takes.
inline constexpr int kMaxNearObstacles = 32;
/// Height of obstacles above and below the ground, as in the original's worlds, [m].
inline constexpr double kObstacleHalfHeight = 0.5;

/// Angle of each wheel about its axle, [rad].
using WheelAngles = std::array<double, kNumWheels>;

/// A Jackal on level ground in an engine, which steps it on by a fixed time of about a millisecond:
/// all that an engine has to do for `EngineBody`.
///
/// The state is a function of the pose of the last `Reset` and of the steps since, bit for bit.
/// Confined to one thread at a time; different worlds may be stepped at the same time.
class World {
 public:
  World() = default;
  virtual ~World() = default;
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  /// Puts the robot at rest with C at the pose, each wheel turned forward about its axle by its
  /// angle, [rad]. At angle 0 the wheel's own axes are C's.
  virtual void Reset(const base::Pose2& X_WC, const WheelAngles& angles) = 0;

  /// Moves on by a step, the wheels' surfaces turning at exactly these speeds. `obstacles`: all
  /// that the robot may touch, at most kMaxNearObstacles, where they are as the step begins. They
  /// do not give way. Returns whether the robot touches one of them as the step begins.
  virtual bool Step(const sim::WheelSpeeds& wheels,
                    std::span<const sim::MovingShape> obstacles) = 0;

  /// Pose and velocity of C's origin, seen from above. The heading is in [-pi, pi].
  virtual sim::BodyState state() const = 0;

  /// Height of the chassis above its place at rest, [m].
  virtual double lift() const = 0;
};

/// Makes `count` worlds with this robot, which step by `step` [s].
using MakeWorlds = std::function<std::vector<std::unique_ptr<World>>(const Jackal& jackal,
                                                                     double step, int count)>;

}  // namespace slalom::engines
