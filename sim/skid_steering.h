#pragma once

#include <array>
#include <cstdint>

#include "sim/environment_config.h"

/// Frame: `C` the robot's directions, x ahead, y left, at its centre of mass.

namespace slalom::sim {

/// Speed of the wheels' surface where they meet the ground, backwards along the body, [m/s]. It
/// equals the body's own speed if the wheels do not slip.
struct WheelSpeeds {
  float left = 0.0f;
  float right = 0.0f;
};

/// The constants of a robot in the equations of motion. `Number`: a float, or one for each lane.
template <class Number>
struct SkidContacts {
  Number friction{};
  Number inverse_radius{};  ///< Inverse radius of a wheel, [1/m].
  Number mass{};            ///< [kg]
  Number inertia{};         ///< [kg m^2]
  /// Contacts in C: x of the axles, [m]; y from the left to the right, [m]; and the greatest
  /// impulse of each in a step, [N s].
  Number front{};
  Number rear{};
  std::array<Number, 4> edges{};
  std::array<Number, 4> front_grips{};
  std::array<Number, 4> rear_grips{};
  /// Load transfer: a change of speed in a step, times these, is taken off the greatest impulse of
  /// each contact in front (on the left) and added to the contacts opposite, [kg]. The transfer is
  /// at most the least impulse at rest, [N s].
  Number shift_ahead{};
  Number shift_left{};
  Number most_shift{};
};

/// Drives of up to `kSize` robots side by side, each of its own constants and law of friction. The
/// numbers of a lane do not depend on the other lanes.
struct SkidLanes {
  static constexpr int kSize = 8;
  using Each = std::array<float, kSize>;

  /// Velocity of the centre of mass, [m/s], in the directions that C has half-way through the last
  /// step, and the turn rate, [rad/s].
  alignas(32) Each ahead{}, left{}, yaw_rate{};
  /// The same one step earlier. The search for the next velocity extrapolates from these two; at
  /// rest and after a contact they are equal.
  alignas(32) Each ahead_before{}, left_before{}, yaw_rate_before{};
  /// Angle by which C turns from half-way through the last step to half-way through the next,
  /// [rad].
  alignas(32) Each turn{};
  /// Angle of each wheel about its axle, [rad]: front left, front right, rear left, rear right. At
  /// 0 the wheel's own x axis points ahead. Half a turn changes nothing, so angles are kept in
  /// [-pi/2, pi/2]. Only the law "gazebo" looks at them.
  alignas(32) std::array<Each, 4> angles{};

  /// Input of a step, set before it: the heading, [rad], within 100, and the speeds of the wheels.
  alignas(32) Each yaw{};
  alignas(32) Each wheel_left{}, wheel_right{};  ///< [m/s]

  /// Output of a step: velocity of the centre of mass in W, [m/s].
  alignas(32) Each vx{}, vy{};

  /// The robots, as `SkidSteering::Enter` sets them. A lane without a robot has no law and stays
  /// at rest.
  static constexpr std::int32_t kNoLaw = -1;
  alignas(32) SkidContacts<Each> contacts{};
  alignas(32) std::array<std::int32_t, kSize> laws = {kNoLaw, kNoLaw, kNoLaw, kNoLaw,
                                                      kNoLaw, kNoLaw, kNoLaw, kNoLaw};
  float dt = 0.0f;  ///< Duration of a step, the same for all, [s].

  /// Moves all robots on by a step. Cost: about 25 ns per lane if all lanes are used and have the
  /// same law; each further law among them adds as much as it would cost alone.
  void Step();

  /// Sets the velocity of a lane, given in W, at that heading, for example after a contact.
  /// `exact_dt`: `dt` before it was rounded, [s].
  void Resume(int lane, float new_yaw, float new_vx, float new_vy, float new_yaw_rate,
              double exact_dt);
};

/// A rigid body on four wheels that turn only about their axles and so must slip to turn the body.
///
/// Wheels stand at (+-wheel_base / 2, +-track / 2) about the point midway between them, turn at the
/// speed that they are told, and carry the loads of sim/mass_distribution.h, which shift as the
/// robot accelerates until the lightest wheel is about to lift: nothing tips over. Each meets the
/// ground at its two edges, wheel_width apart, with half its load at each. Dry friction acts there
/// by one of the laws of docs/simulator.md, rounded off below a slip of 1 mm/s. A step is implicit:
/// it is stable for any `dt`, and takes kinetic energy from a body on standing wheels.
///
/// Immutable. `SkidLanes::Step` gives the same bits on every machine, and in every lane.
class SkidSteering {
 public:
  static constexpr int kMaxRounds = 8;

  /// `dt`: duration of a step, [s]. Requires: `CheckMassDistribution(config)` passes.
  SkidSteering(const RobotConfig& config, double dt);

  /// Surface speeds that the drive's controller asks for to go at `linear` [m/s] and turn at
  /// `angular` [rad/s], as if the wheels stood track x multiplier apart and did not slip; the right
  /// ones faster by the configured imbalance.
  WheelSpeeds Wheels(double linear, double angular) const {
    const double side = half_separation_ * angular;
    return {static_cast<float>((1.0 - half_imbalance_) * (linear - side)),
            static_cast<float>((1.0 + half_imbalance_) * (linear + side))};
  }

  /// Makes this the robot of a lane, whose other numbers stay as they are. Requires: all robots of
  /// `lanes` have the same `dt`.
  void Enter(SkidLanes& lanes, int lane) const;

  /// Whether the law depends on the wheels' angles.
  bool needs_angles() const { return law_ == FrictionLaw::kGazebo; }

 private:
  const FrictionLaw law_;
  const double half_separation_;  // As the controller assumes it, [m].
  const double half_imbalance_;
  const float dt_;  // [s]
  const SkidContacts<float> contacts_;
};

}  // namespace slalom::sim
