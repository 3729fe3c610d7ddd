#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/geometry.h"
#include "sim/contact_world.h"
#include "sim/drive_controller.h"
#include "sim/environment_config.h"
#include "sim/robot_body.h"
#include "sim/scene.h"
#include "sim/skid_steering.h"

namespace slalom::sim {

/// The Jackal: a rigid body on wheels whose speeds follow commands exactly, through a velocity
/// controller that runs at `control_rate`, with the configured limits, yaw gain and delay. The
/// drive says how the wheels move the body: with slip (sim/skid_steering.h), or ideally, which is
/// forward and about its centre as commanded and never sideways.
///
/// The robot's pose is the pose of R, the point midway between the wheels, from which footprint and
/// LiDAR are measured. The simulation moves the centre of mass C: wheels act on C's velocity, then
/// contacts do, then C moves. Without contact it moves exactly as Box2D would move it, so Box2D is
/// only called while the robot touches something; the result is the same to the bit.
/// Thread-compatible; a value. Copies share the Box2D world that they need for that.
class Robot final : public RobotBody {
 public:
  /// The rigid-body steps that Box2D computes.
  enum class Stepping {
    kBox2dInContact,  ///< Those that begin in contact.
    kBox2dAlways,     ///< All of them. The same results, slower: the reference for tests.
  };

  /// `num_substeps`: rigid-body steps in a control step. Requires: num_substeps >= 1.
  Robot(const RobotConfig& config, int num_substeps, Stepping stepping = Stepping::kBox2dInContact);

  /// Makes room for `num_moving` moving obstacles, so that `Drive` allocates nothing.
  void Reserve(int num_moving);

  /// Also draws the angle of each wheel uniformly from `seed`, because the original puts its robot
  /// back with the wheels as the last episode left them.
  void Reset(const base::Pose2& X_WR, std::uint64_t seed = 0) override;

  /// Turns all wheels to this angle about their axles, [rad] (sim/skid_steering.h). Meant for
  /// comparisons with recorded drives, which begin with a known angle.
  void TurnWheelsTo(double angle);

  /// Looks for contact at the start and after each of the rigid-body steps.
  bool Drive(double linear, double angular, const Scene& scene, double motion_time) override;

  /// Gives the results of `Drive` in a fraction of the time. Requires: all are `Robot`s of the same
  /// control rate, number of rigid-body steps and stepping.
  void DriveTogether(std::span<Order> orders) override;

  /// Pose of R.
  base::Pose2 pose() const override;
  /// Pose of R with its heading not wrapped, and the velocity of R.
  const BodyState& body() const override { return body_; }
  const DriveController& drive() const override { return controller_; }

 private:
  void Begin(const Order& order, SkidLanes& lanes, int lane);
  void TurnWheels(int substep, SkidLanes& lanes, int lane);
  void Move(int substep, const Order& order, SkidLanes& lanes, int lane);
  void End(const SkidLanes& lanes, int lane);
  bool Touches() const;
  FootprintPose Outline() const;
  void LookAround(const CollisionMap& map);
  void MoveIdeally(const DriveCommand& wheels);
  void FindMoving(const MovingObstacles& moving, double time, double duration);
  void PlaceMoving(const MovingObstacles& moving, double time);

  const Footprint footprint_;
  const float centre_x_;  // Centre of mass in R, [m].
  const float centre_y_;  // [m]
  const float reach_;     // Upper bound of the distance from C to the outline's corners, [m].
  const double dt_;       // Duration of a rigid-body step, [s].
  const std::optional<SkidSteering> skid_steering_;  // Empty for the ideal drive.
  const int num_substeps_;
  const Stepping stepping_;

  BodyState centre_;  // State of C.
  BodyState body_;    // State of R at the end of a control step.
  DriveController controller_;
  std::shared_ptr<ContactWorld> contacts_;

  // The skid-steering state between control steps, as in `SkidLanes`.
  struct Slip {
    float ahead, left, yaw_rate;
    float ahead_before, left_before, yaw_rate_before;
    float turn;
    std::array<float, 4> angles;
  };
  Slip slip_{};

  float clearance_ = 0.0f;  // Lower bound to the fixed obstacles, [m]; 0 if not known.

  // Moving obstacles that can come near in this control step while the robot's centre stays within
  // kTravel of (found_x_, found_y_); their present places; and the distance to the nearest of them.
  std::vector<int> moving_;
  std::vector<MovingShape> moving_shapes_;
  float moving_clearance_ = 0.0f;  // [m]
  float found_x_ = 0.0f;           // [m]
  float found_y_ = 0.0f;           // [m]
};

/// Makes bodies of Slalom's own physics.
MakeRobotBodies MakeRobots(Robot::Stepping stepping = Robot::Stepping::kBox2dInContact);

}  // namespace slalom::sim
