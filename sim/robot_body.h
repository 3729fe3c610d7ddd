#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/geometry.h"
#include "sim/drive_controller.h"
#include "sim/environment_config.h"
#include "sim/scene.h"

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

/// The robot's body and its drive, as `CourseEnvironments` drives them: the seam between a task and
/// the physics that moves the robot. `Robot` is Slalom's own; sim/engines/ has the bodies of other
/// physics.
///
/// A drive is a function of the pose and the seed of the last `Reset` and of the calls since, bit
/// for bit. Confined to one thread at a time; different bodies may be driven at the same time.
class RobotBody {
 public:
  virtual ~RobotBody() = default;

  /// Puts the robot at rest, with no command under way. `seed` determines the commands' jitter.
  virtual void Reset(const base::Pose2& X_WR, std::uint64_t seed) = 0;

  /// Drives for one control step, which begins at `motion_time` [s], towards the commanded speeds
  /// (`linear` [m/s], `angular` [rad/s]). Returns whether it touched anything; moving obstacles are
  /// where they are at each moment of the step.
  virtual bool Drive(double linear, double angular, const Scene& scene, double motion_time) = 0;

  /// One robot's control step for `DriveTogether`.
  struct Order {
    RobotBody* robot = nullptr;
    const Scene* scene = nullptr;
    double linear = 0.0;       ///< [m/s]
    double angular = 0.0;      ///< [rad/s]
    double motion_time = 0.0;  ///< [s]
    bool touched = false;      ///< The result: what `Drive` returns.
  };

  /// Drives many robots, of which this may be one, with the same results as `Drive`. A physics that
  /// can step robots side by side in less time overrides it. Requires: all were made by the same
  /// `MakeRobotBodies`, for the same control rate and step.
  virtual void DriveTogether(std::span<Order> orders) {
    for (Order& order : orders) {
      order.touched =
          order.robot->Drive(order.linear, order.angular, *order.scene, order.motion_time);
    }
  }

  /// Pose in W, heading in [-pi, pi).
  virtual base::Pose2 pose() const = 0;
  virtual const BodyState& body() const = 0;
  /// The controller that turns its wheels.
  virtual const DriveController& drive() const = 0;

 protected:
  RobotBody() = default;
  RobotBody(const RobotBody&) = default;
  RobotBody& operator=(const RobotBody&) = default;
};

/// Makes `count` bodies of the configured robot, each of which can drive in any of `scenes`. Throws
/// `base::Error` that names the key or the course if this physics cannot represent it. Thread-safe.
using MakeRobotBodies = std::function<std::vector<std::unique_ptr<RobotBody>>(
    const EnvironmentConfig& config, std::span<const std::shared_ptr<const Scene>> scenes,
    int count)>;

/// The physics that moves the robot. A value.
struct Physics {
  std::string name = "slalom";
  std::string version{};          ///< The engine's version. Empty for Slalom's own physics.
  MakeRobotBodies make_bodies{};  ///< Empty for Slalom's own physics.
};

}  // namespace slalom::sim
