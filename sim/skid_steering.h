#pragma once

#include "sim/environment_config.h"

/// Frame: `R` the robot, x ahead, y left, at its centre of mass.

namespace slalom::sim {

/// Velocity of a body in the directions of R. A value.
struct BodyVelocity {
  float ahead = 0.0f;     ///< [m/s]
  float left = 0.0f;      ///< [m/s]
  float yaw_rate = 0.0f;  ///< [rad/s]
};

/// Speed of the wheels' surface where they meet the ground, backwards along the body, [m/s]: what
/// the body's own speed would be if they did not slip.
struct WheelSpeeds {
  float left = 0.0f;
  float right = 0.0f;
};

/// A rigid body on four wheels that turn only about their axles and so must slip to turn the body.
///
/// Each wheel stands at (+-wheel_base / 2, +-track / 2), carries a quarter of the weight and turns
/// at the speed that it is told. Coulomb friction acts against its slip, of `wheel_friction` times
/// its load, in whatever direction (a cone). What follows, without further parameters: turn rate
/// and side-slip in turns, acceleration and braking limited to friction x g, drifting where speed x
/// turn rate is beyond that. In pure rotation the balance of torques gives
///
///     yaw rate / commanded = multiplier x track^2 / (wheel_base^2 + track^2),
///
/// 1.009 with the Jackal's numbers: its controller's multiplier 1.5 makes up for just this slip.
///
/// A step is implicit: the new velocity minimises
///
///     1/2 |change|^2 in the kinetic norm + sum over wheels of friction x load x dt x |slip|,
///
/// |slip| rounded off below 1 mm/s, by four rounds of Weiszfeld's fixed point, in each of which
/// friction is viscous, as strong as dry friction is at the slip found last. Newton's method would
/// need a line search here. Each such round alone takes kinetic energy from a body on standing
/// wheels, for any step size, and leaves a steady state where it is.
///
/// Immutable. The same bits on every machine.
class SkidSteering {
 public:
  /// `dt`: of a step, [s].
  SkidSteering(const RobotConfig& config, double dt);

  /// Surface speeds that the drive's controller asks for to go at `linear` [m/s] and turn at
  /// `angular` [rad/s], as if the wheels stood track x multiplier apart and did not slip; the right
  /// ones faster by the configured imbalance.
  WheelSpeeds Wheels(double linear, double angular) const {
    const double side = half_separation_ * angular;
    return {static_cast<float>((1.0 - half_imbalance_) * (linear - side)),
            static_cast<float>((1.0 + half_imbalance_) * (linear + side))};
  }

  /// The velocity a step later, in the same directions. `near`: a velocity near it, where the
  /// search begins; in a steady turn that is where `velocity` pointed a step ago, from which the
  /// search does not depart. Cost: about 80 ns.
  BodyVelocity Step(const BodyVelocity& velocity, const BodyVelocity& near,
                    const WheelSpeeds& wheels) const;

 private:
  const double half_separation_;  // As the controller believes, [m].
  const double half_imbalance_;
  const float half_base_;   // [m]
  const float half_track_;  // [m]
  const float mass_;        // [kg]
  const float inertia_;     // [kg m^2]
  const float grip_;        // Greatest impulse of a wheel in a step, [N s].
};

}  // namespace slalom::sim
