#include "sim/skid_steering.h"

namespace slalom::sim {
namespace {

constexpr double kGravity = 9.8;  // As the original's worlds set it, [m/s^2].
constexpr float kCreep = 1e-3f;   // Below this slip, friction fades, [m/s].
constexpr int kRounds = 4;

/// One number for each wheel: left front, left back, right front, right back.
using PerWheel = float __attribute__((vector_size(16)));

PerWheel Root(PerWheel a) {
  for (int i = 0; i < 4; ++i) a[i] = __builtin_sqrtf(a[i]);
  return a;
}

}  // namespace

SkidSteering::SkidSteering(const RobotConfig& config, double dt)
    : half_separation_(0.5 * config.track * config.wheel_separation_multiplier),
      half_imbalance_(0.5 * config.wheel_imbalance),
      half_base_(static_cast<float>(0.5 * config.wheel_base)),
      half_track_(static_cast<float>(0.5 * config.track)),
      mass_(static_cast<float>(config.mass)),
      inertia_(static_cast<float>(config.yaw_inertia)),
      grip_(static_cast<float>(config.wheel_friction * 0.25 * config.mass * kGravity * dt)) {}

BodyVelocity SkidSteering::Step(const BodyVelocity& velocity, const BodyVelocity& near,
                                const WheelSpeeds& wheels) const {
  const float a = half_base_, b = half_track_;
  const PerWheel wheel_speed{wheels.left, wheels.left, wheels.right, wheels.right};
  const PerWheel x{a, -a, a, -a};
  const PerWheel y{b, b, -b, -b};
  BodyVelocity v = near;
  for (int round = 0; round < kRounds; ++round) {
    const PerWheel slip_ahead = v.ahead - v.yaw_rate * y - wheel_speed;
    const PerWheel slip_left = v.left + v.yaw_rate * x;
    // Of a viscous friction that acts like the dry one at this slip, [kg].
    const PerWheel drag =
        grip_ / Root(slip_ahead * slip_ahead + slip_left * slip_left + kCreep * kCreep);
    const float left = drag[0] + drag[1], right = drag[2] + drag[3];
    const float drag_sum = left + right;
    const float drag_x = a * ((drag[0] - drag[1]) + (drag[2] - drag[3]));
    const float drag_y = b * (left - right);
    // Minimum of the quadratic form: three linear equations, of which the first two are solved for
    // the speeds in terms of the turn rate.
    const float inverse = 1.0f / (mass_ + drag_sum);
    const float push_ahead = mass_ * velocity.ahead + (left * wheels.left + right * wheels.right);
    const float push_left = mass_ * velocity.left;
    const float push_turn =
        inertia_ * velocity.yaw_rate + b * (right * wheels.right - left * wheels.left);
    v.yaw_rate =
        (push_turn + inverse * (drag_y * push_ahead - drag_x * push_left)) /
        (inertia_ + (a * a + b * b) * drag_sum - inverse * (drag_x * drag_x + drag_y * drag_y));
    v.ahead = inverse * (push_ahead + drag_y * v.yaw_rate);
    v.left = inverse * (push_left - drag_x * v.yaw_rate);
  }
  return v;
}

}  // namespace slalom::sim
