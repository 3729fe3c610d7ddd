#pragma once

#include <Eigen/Core>

/// Frames: `O` where the robot was when a prediction began; `C` the robot's directions, x ahead, y
/// left, at its centre of mass.

namespace slalom::planners {

inline constexpr double kGravity = 9.81;  ///< [m/s^2]

/// What a guard knows of its robot. A value.
struct RobotModel {
  double length = 0.458;       ///< Outline along the driving direction, [m].
  double width = 0.416;        ///< Outline across the driving direction, [m].
  double mass = 18.431;        ///< [kg]
  double yaw_inertia = 0.554;  ///< About the centre of mass, [kg m^2].
  /// The centre of mass, from the point midway between the wheels, which is the outline's middle.
  double centre_x = 0.01076;  ///< [m]
  double centre_y = 0.00179;  ///< [m]
  double centre_z = 0.1271;   ///< Above the ground, [m]; 0: loads do not shift.
  double wheel_base = 0.262;  ///< From the front to the rear axle, [m].
  double track = 0.37559;     ///< From the left to the right wheels, [m].
  /// The drive's controller assumes a track this many times as wide.
  double wheel_separation_multiplier = 1.5;
  double friction = 0.5;  ///< Of the wheels on the ground.
  bool slips = true;      ///< Whether wheels slip, or move the body exactly as they are told.
  /// Whether a wheel rubs ahead and to the side independently, or in all directions alike.
  bool pyramid = false;
  double linear_limit = 2.0;           ///< Commands are clipped to this speed, [m/s].
  double angular_limit = 4.0;          ///< And to this turn rate, [rad/s].
  double linear_acceleration = 20.0;   ///< Of the wheels, [m/s^2].
  double angular_acceleration = 25.0;  ///< [rad/s^2]
  /// From the choice of a command until the drive acts on it, at least and at most, [s].
  double least_delay = 0.0, delay = 0.0;
};

/// Robots that are predicted side by side, each from its own commands.
inline constexpr int kLanes = 8;
using Lanes = Eigen::Array<float, kLanes, 1>;

/// Where the robots of all lanes are, and how they move. A value.
struct Motion {
  Lanes x = Lanes::Zero(), y = Lanes::Zero();      ///< Of the centre of mass in O, [m].
  Lanes sin = Lanes::Zero(), cos = Lanes::Ones();  ///< Of the heading in O.
  Lanes ahead = Lanes::Zero(),
        left = Lanes::Zero();           ///< Velocity of the centre of mass, in C, [m/s].
  Lanes yaw_rate = Lanes::Zero();       ///< [rad/s]
  Lanes wheel_linear = Lanes::Zero();   ///< Speed that the wheels are told, [m/s].
  Lanes wheel_angular = Lanes::Zero();  ///< Turn rate that the wheels are told, [rad/s].
};

/// A body on four wheels that slip: each carries its share of the weight, and rubs on the ground at
/// one point with dry friction. It is what is known of a robot from its data sheet; tests hold it
/// against the simulator's drive, which knows more (sim/skid_steering.h). Immutable.
class DriveModel {
 public:
  /// `tick`: time of a step, about 0.02 s.
  DriveModel(const RobotModel& robot, double tick);

  /// Moves the robots on by a step, driven by the commands `linear` [m/s] and `angular` [rad/s].
  void Step(const Lanes& linear, const Lanes& angular, Motion& motion) const;

 private:
  template <bool pyramid>
  void Slip(Motion& motion) const;

  const float tick_;  // [s]
  const bool slips_, pyramid_;
  const float linear_limit_, angular_limit_;  // [m/s], [rad/s]
  const float linear_step_, angular_step_;    // Largest change of the wheels' speeds in a step.
  const float half_separation_;               // As the controller assumes it, [m].
  const float mass_, inertia_;                // [kg], [kg m^2]
  // Contacts in C: x of the axles in front and behind, y of the wheels on the left and right, [m],
  // and the greatest impulse of each, by axle and side, [N s].
  float axle_[2], side_[2], grip_[2][2];
  // Speeding up, ahead or to the left, takes that much off the contacts in front or on the left,
  // and adds it opposite, [kg]; no contact loses more than the lightest has, [N s].
  float shift_ahead_, shift_left_, most_shift_;
};

}  // namespace slalom::planners
