#pragma once

#include <array>
#include <cstdint>
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
/// controller that runs at `control_rate`, with the configured limits, yaw gain and delay. How the
/// wheels move the body is the drive: with slip (sim/skid_steering.h), or ideally, ahead and about
/// its centre as commanded and never sideways.
///
/// The robot's pose is that of R, the point midway between the wheels, from which footprint and
/// LiDAR are measured. What moves is its centre of mass C: wheels act on C's velocity, then
/// contacts do, then it moves. Without contact it moves as Box2D itself would then, so Box2D is
/// only called while something is touched; the result is the same to the bit. Thread-compatible; a
/// value.
class Robot final : public RobotBody {
 public:
  /// Which rigid-body steps are Box2D's.
  enum class Stepping {
    kBox2dInContact,  ///< Those that begin in contact.
    kBox2dAlways,     ///< All of them. The same results, slower: the reference for tests.
  };

  /// `num_substeps`: rigid-body steps in a control step. Requires: num_substeps >= 1.
  Robot(const RobotConfig& config, int num_substeps, Stepping stepping = Stepping::kBox2dInContact);

  /// Makes room for that many moving obstacles, so that `Drive` allocates nothing.
  void Reserve(int num_moving);

  /// The angles of the wheels are drawn from `seed`, too, each uniformly: the original puts its
  /// robot back as it is, its wheels turned as the last episode left them.
  void Reset(const base::Pose2& X_WR, std::uint64_t seed = 0) override;

  /// Turns all wheels to this angle about their axles, [rad] (sim/skid_steering.h). For comparisons
  /// with drives that began so.
  void TurnWheelsTo(double angle);

  /// Looks for contact at the start and after each of the rigid-body steps.
  bool Drive(double linear, double angular, const Scene& scene, double motion_time,
             ContactWorld& contacts) override;

  /// In a fraction of the time. Requires: all are `Robot`s of the same config, number of rigid-body
  /// steps and stepping.
  void DriveTogether(std::span<Order> orders, ContactWorld& contacts) override;

  /// Pose of R.
  base::Pose2 pose() const override;
  /// That pose, its heading not wrapped, and the velocity of R.
  const BodyState& body() const override { return body_; }
  const DriveController& drive() const override { return controller_; }

 private:
  void Begin(const Order& order, SkidLanes& lanes, int lane);
  void TurnWheels(int substep, SkidLanes& lanes, int lane);
  void Move(int substep, const Order& order, ContactWorld& contacts, SkidLanes& lanes, int lane);
  void End(const SkidLanes& lanes, int lane);
  bool Touches() const;
  FootprintPose Outline() const;
  void LookAround(const CollisionMap& map);
  void MoveIdeally(const DriveCommand& wheels);
  void FindMoving(const MovingObstacles& moving, double time, double duration);
  void PlaceMoving(const MovingObstacles& moving, double time);

  const Footprint footprint_;
  const float centre_x_;  // Of mass, in R, [m].
  const float centre_y_;  // [m]
  const float reach_;     // From there to the farthest corner of the outline, at most, [m].
  const double dt_;       // Of a rigid-body step, [s].
  const std::optional<SkidSteering> skid_steering_;  // None: ideal.
  const int num_substeps_;
  const Stepping stepping_;

  BodyState centre_;  // Of C.
  BodyState body_;    // Of R, at the end of a control step.
  DriveController controller_;

  // Skid-steering: as in `SkidLanes`, between control steps.
  struct Slip {
    float ahead, left, yaw_rate;
    float ahead_before, left_before, yaw_rate_before;
    float turn;
    std::array<float, 4> angles;
  };
  Slip slip_{};

  float clearance_ = 0.0f;  // No fixed obstacle is nearer, [m]; 0: not known.

  // Moving obstacles that can come near in this control step while the robot's centre stays within
  // kTravel of (found_x_, found_y_); where they are now; and the distance to the nearest of them.
  std::vector<int> moving_;
  std::vector<MovingShape> moving_shapes_;
  float moving_clearance_ = 0.0f;  // [m]
  float found_x_ = 0.0f;           // [m]
  float found_y_ = 0.0f;           // [m]
};

}  // namespace slalom::sim
