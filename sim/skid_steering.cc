#include "sim/skid_steering.h"

#include <cmath>
#include <cstring>

namespace slalom::sim {
namespace {

constexpr double kGravity = 9.8;  // As the original's worlds set it, [m/s^2].
constexpr float kCreep = 1e-3f;   // Below this slip, friction fades, [m/s].
constexpr float kStill = 5e-4f;   // A round that changes the velocity by less is the last, [m/s].
constexpr float kArm = 0.25f;     // From the centre to a contact, about, [m].

/// One number for each contact of an axle, from the left to the right; or for each wheel.
using Four = float __attribute__((vector_size(16)));
using FourInts = int __attribute__((vector_size(16)));

Four Load(const std::array<float, 4>& from) {
  Four v;
  std::memcpy(&v, from.data(), sizeof v);
  return v;
}
Four Root(Four a) {
  for (int i = 0; i < 4; ++i) a[i] = __builtin_sqrtf(a[i]);
  return a;
}
Four Max(Four a, Four b) { return a > b ? a : b; }
float Sum(Four a) { return (a[0] + a[1]) + (a[2] + a[3]); }

/// For the contacts of the front and of the rear axle, from numbers for each wheel.
Four OfFront(Four wheels) { return Four{wheels[0], wheels[0], wheels[1], wheels[1]}; }
Four OfRear(Four wheels) { return Four{wheels[2], wheels[2], wheels[3], wheels[3]}; }

/// Sine and cosine of angles in [-pi/2, pi/2], within 4e-6.
Four Sine(Four a) {
  const Four z = a * a;
  return a * (1.0f + z * (-1.0f / 6 + z * (1.0f / 120 + z * (-1.0f / 5040 + z / 362880))));
}
Four Cosine(Four a) {
  const Four z = a * a;
  return 1.0f + z * (-1.0f / 2 + z * (1.0f / 24 +
                                      z * (-1.0f / 720 + z * (1.0f / 40320 - z / 3628800))));
}

/// The vertical planes of friction at an axle's contacts: the greatest impulse in a step, and what
/// part of it presses the wheel down.
struct Grip {
  Four impulse;  // [N s]
  Four press;
};

/// Viscous friction that acts like the dry one at some slip, summed over an axle's contacts.
struct AxleDrag {
  Four ahead;  // For each contact, [kg].
  float left;  // For all, which slip alike to the left, [kg].
};

template <FrictionLaw law>
AxleDrag DragOf(const Grip& grip, Four slip_ahead, Four square_ahead, Four root_ahead,
                float slip_left) {
  const float square_left = slip_left * slip_left;
  if constexpr (law == FrictionLaw::kCone) {
    const Four drag = grip.impulse / Root(square_ahead + square_left);
    return {drag, Sum(drag)};
  }
  const Four bound = law == FrictionLaw::kGazebo ? root_ahead + grip.press * slip_ahead : root_ahead;
  const Four drag = grip.impulse / bound;
  return {drag, Sum(drag * root_ahead) / __builtin_sqrtf(square_left + kCreep * kCreep)};
}

}  // namespace

SkidSteering::SkidSteering(const RobotConfig& config, double dt)
    : SkidSteering(config, DistributeMass(config), dt) {}

SkidSteering::SkidSteering(const RobotConfig& config, const MassDistribution& masses, double dt)
    : law_(config.friction),
      half_separation_(0.5 * config.track * config.wheel_separation_multiplier),
      half_imbalance_(0.5 * config.wheel_imbalance),
      friction_(static_cast<float>(config.wheel_friction)),
      inverse_radius_(static_cast<float>(1.0 / config.wheel_radius)),
      mass_(static_cast<float>(masses.mass)),
      inertia_(static_cast<float>(masses.yaw_inertia)),
      front_(static_cast<float>(0.5 * config.wheel_base - masses.x)),
      rear_(static_cast<float>(-0.5 * config.wheel_base - masses.x)),
      // An eighth of friction x mass x height x acceleration over half the distance of the wheels.
      shift_ahead_(static_cast<float>(0.25 * config.wheel_friction * masses.mass * masses.height /
                                      config.wheel_base)),
      shift_left_(static_cast<float>(0.25 * config.wheel_friction * masses.mass * masses.height /
                                     config.track)) {
  const double impulse = config.wheel_friction * masses.mass * kGravity * dt;
  for (int i = 0; i < 4; ++i) {
    const int side = i / 2;  // 0 left, 1 right.
    const double middle = (side == 0 ? 0.5 : -0.5) * config.track;
    const double to_edge = (i % 2 == 0 ? 0.5 : -0.5) * config.wheel_width;
    edges_[i] = static_cast<float>(middle + to_edge - masses.y);
    front_grips_[i] = static_cast<float>(0.5 * impulse * masses.loads[side]);
    rear_grips_[i] = static_cast<float>(0.5 * impulse * masses.loads[2 + side]);
  }
}

BodyVelocity SkidSteering::Step(const BodyVelocity& velocity, const BodyVelocity& near,
                                const WheelSpeeds& wheels, const WheelAngles& angles) const {
  switch (law_) {
    case FrictionLaw::kCone:
      return Search<FrictionLaw::kCone>(velocity, near, wheels, angles);
    case FrictionLaw::kPyramid:
      return Search<FrictionLaw::kPyramid>(velocity, near, wheels, angles);
    case FrictionLaw::kGazebo:
      break;
  }
  return Search<FrictionLaw::kGazebo>(velocity, near, wheels, angles);
}

template <FrictionLaw law>
BodyVelocity SkidSteering::Search(const BodyVelocity& velocity, const BodyVelocity& near,
                                  const WheelSpeeds& wheels, const WheelAngles& angles) const {
  const Four y = Load(edges_);
  const Four speeds{wheels.left, wheels.left, wheels.right, wheels.right};
  const Four front_load = Load(front_grips_), rear_load = Load(rear_grips_);
  const Four shift_left{shift_left_, shift_left_, -shift_left_, -shift_left_};
  Four front_part = Four{} + 1.0f, rear_part = front_part, front_press{}, rear_press{};
  if constexpr (law == FrictionLaw::kGazebo) {
    const Four angle = Load(angles);
    const Four cosine = Max(Cosine(angle), Four{}), press = friction_ * Sine(angle);
    front_part = OfFront(cosine), rear_part = OfRear(cosine);
    front_press = OfFront(press), rear_press = OfRear(press);
  }
  BodyVelocity v = near;
  for (int round = 0; round < kMaxRounds; ++round) {
    // Speeding up takes weight off the wheels in front and in the direction of the change.
    const float to_rear = shift_ahead_ * (v.ahead - velocity.ahead);
    const Four to_right = shift_left * (v.left - velocity.left);
    const Grip front_grip{Max(front_load - to_rear - to_right, Four{}) * front_part, front_press};
    const Grip rear_grip{Max(rear_load + to_rear - to_right, Four{}) * rear_part, rear_press};
    const Four slip_ahead = (v.ahead - v.yaw_rate * y) - speeds;
    const Four square_ahead = slip_ahead * slip_ahead + kCreep * kCreep;
    const Four root_ahead = law == FrictionLaw::kCone ? Four{} : Root(square_ahead);
    const AxleDrag front = DragOf<law>(front_grip, slip_ahead, square_ahead, root_ahead,
                                       v.left + v.yaw_rate * front_);
    const AxleDrag rear =
        DragOf<law>(rear_grip, slip_ahead, square_ahead, root_ahead, v.left + v.yaw_rate * rear_);
    // Sums over the contacts of the drag ahead, by powers of y, and with the wheels' speeds; and of
    // the drag to the left, by powers of x.
    const Four drag = front.ahead + rear.ahead;
    const Four drag_y = drag * y;
    const float left_side = drag[0] + drag[1], right_side = drag[2] + drag[3];
    const float left_y = drag_y[0] + drag_y[1], right_y = drag_y[2] + drag_y[3];
    const float ahead_y = left_y + right_y, ahead_yy = Sum(drag_y * y);
    const float left_x = front_ * front.left + rear_ * rear.left;
    const float left_xx = front_ * front_ * front.left + rear_ * rear_ * rear.left;
    const float heavy_ahead = mass_ + (left_side + right_side);
    const float heavy_left = mass_ + (front.left + rear.left);
    const float push_ahead = mass_ * velocity.ahead + (left_side * wheels.left + right_side * wheels.right);
    const float push_left = mass_ * velocity.left;
    const float push_turn = inertia_ * velocity.yaw_rate - (left_y * wheels.left + right_y * wheels.right);
    // Three linear equations, of which the first two are solved for the speeds in terms of the turn
    // rate:
    //   heavy_ahead ahead - ahead_y yaw_rate = push_ahead
    //   heavy_left left + left_x yaw_rate = push_left
    //   (inertia + ahead_yy + left_xx) yaw_rate - ahead_y ahead + left_x left = push_turn.
    const float per_ahead = 1.0f / heavy_ahead, per_left = 1.0f / heavy_left;
    const float yaw_rate = (push_turn + ahead_y * per_ahead * push_ahead - left_x * per_left * push_left) /
        (inertia_ + ahead_yy + left_xx - ahead_y * ahead_y * per_ahead - left_x * left_x * per_left);
    const BodyVelocity next{(push_ahead + ahead_y * yaw_rate) * per_ahead, (push_left - left_x * yaw_rate) * per_left, yaw_rate};
    const float change = std::abs(next.ahead - v.ahead) + std::abs(next.left - v.left) +
                         kArm * std::abs(next.yaw_rate - v.yaw_rate);
    v = next;
    if (change < kStill) break;
  }
  return v;
}

void SkidSteering::Turn(const WheelSpeeds& wheels, double duration, WheelAngles& angles) const {
  constexpr float kHalfTurn = 3.14159265f;
  constexpr float kShift = 1024.0f;  // Half turns are counted from here, to round downwards.
  const Four speeds{wheels.left, wheels.right, wheels.left, wheels.right};
  const Four turned = Load(angles) + speeds * (static_cast<float>(duration) * inverse_radius_);
  const Four count = turned * (1.0f / kHalfTurn) + (kShift + 0.5f);
  const Four whole =
      __builtin_convertvector(__builtin_convertvector(count, FourInts), Four) - kShift;
  const Four rest = turned - whole * kHalfTurn;
  std::memcpy(angles.data(), &rest, sizeof rest);
}

}  // namespace slalom::sim
