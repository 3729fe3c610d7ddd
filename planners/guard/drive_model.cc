#include "planners/guard/drive_model.h"

#include <algorithm>

namespace slalom::planners {
namespace {

constexpr float kCreep = 1e-3f;  // Below this slip, friction fades, [m/s].
// Rounds of the search for the friction of a step.
constexpr int kRounds = 3;

Lanes Towards(const Lanes& from, const Lanes& to, float step) {
  return from + (to - from).max(-step).min(step);
}

}  // namespace

DriveModel::DriveModel(const RobotModel& robot, double tick)
    : tick_(static_cast<float>(tick)),
      slips_(robot.slips),
      pyramid_(robot.pyramid),
      linear_limit_(static_cast<float>(robot.linear_limit)),
      angular_limit_(static_cast<float>(robot.angular_limit)),
      linear_step_(static_cast<float>(robot.linear_acceleration * tick)),
      angular_step_(static_cast<float>(robot.angular_acceleration * tick)),
      half_separation_(static_cast<float>(0.5 * robot.track * robot.wheel_separation_multiplier)),
      mass_(static_cast<float>(robot.mass)),
      inertia_(static_cast<float>(robot.yaw_inertia)) {
  const double impulse = robot.friction * robot.mass * kGravity * tick;
  const double lean_x = robot.centre_x / (0.5 * robot.wheel_base);
  const double lean_y = robot.centre_y / (0.5 * robot.track);
  const double shift = 0.5 * robot.friction * robot.mass * robot.centre_z;
  shift_ahead_ = static_cast<float>(shift / robot.wheel_base);
  shift_left_ = static_cast<float>(shift / robot.track);
  for (int i = 0; i < 2; ++i) {
    const double sign = i == 0 ? 1.0 : -1.0;
    axle_[i] = static_cast<float>(sign * 0.5 * robot.wheel_base - robot.centre_x);
    side_[i] = static_cast<float>(sign * 0.5 * robot.track - robot.centre_y);
    for (int j = 0; j < 2; ++j) {
      const double lean = sign * lean_x + (j == 0 ? lean_y : -lean_y);
      grip_[i][j] = static_cast<float>(0.25 * (1.0 + lean) * impulse);
    }
  }
  // A little less, so that rounding leaves nothing negative.
  most_shift_ = 0.999f * std::min({grip_[0][0], grip_[0][1], grip_[1][0], grip_[1][1]});
}

void DriveModel::Step(const Lanes& linear, const Lanes& angular, Motion& m) const {
  m.wheel_linear =
      Towards(m.wheel_linear, linear.max(-linear_limit_).min(linear_limit_), linear_step_);
  m.wheel_angular =
      Towards(m.wheel_angular, angular.max(-angular_limit_).min(angular_limit_), angular_step_);
  // The heading half-way through the step, as the turn rate was: forces and way are along it.
  const Lanes before = m.yaw_rate;
  if (slips_) {
    pyramid_ ? Slip<true>(m) : Slip<false>(m);
  } else {
    m.ahead = m.wheel_linear;
    m.left.setZero();
    m.yaw_rate = m.wheel_angular;
  }
  const auto turn = [&m](const Lanes& angle) {
    const Lanes square = angle * angle;
    const Lanes sine = angle * (1.0f - square * (1.0f / 6)), cosine = 1.0f - 0.5f * square;
    const Lanes sin = m.sin * cosine + m.cos * sine;
    m.cos = m.cos * cosine - m.sin * sine;
    m.sin = sin;
  };
  turn(0.5f * tick_ * before);
  m.x += tick_ * (m.cos * m.ahead - m.sin * m.left);
  m.y += tick_ * (m.sin * m.ahead + m.cos * m.left);
  turn(tick_ * (m.yaw_rate - 0.5f * before));
}

/// The velocity after an implicit step: it minimises the kinetic energy of its change and what the
/// contacts rub. In each round (Weiszfeld) friction is viscous, as strong as dry friction is at the
/// slip that was found last, which gives three linear equations for speeds and turn rate.
template <bool pyramid>
void DriveModel::Slip(Motion& m) const {
  // C turns under the velocity, from half-way through the last step to half-way through this one.
  const Lanes angle = tick_ * m.yaw_rate;
  const Lanes now_ahead = m.ahead + angle * m.left - 0.5f * angle * angle * m.ahead;
  const Lanes now_left = m.left - angle * m.ahead - 0.5f * angle * angle * m.left;
  const Lanes now_rate = m.yaw_rate;
  const Lanes wheels[2] = {m.wheel_linear - half_separation_ * m.wheel_angular,
                           m.wheel_linear + half_separation_ * m.wheel_angular};
  Lanes ahead = now_ahead, left = now_left, rate = now_rate;
  for (int round = 0; round < kRounds; ++round) {
    Lanes drag = Lanes::Zero(), drag_y = Lanes::Zero(), push = Lanes::Zero(),
          push_y = Lanes::Zero();
    Lanes drag_left = Lanes::Zero(), drag_x = Lanes::Zero(), moment = Lanes::Zero();
    const Lanes to_rear = (shift_ahead_ * (ahead - now_ahead)).max(-most_shift_).min(most_shift_);
    const Lanes room = most_shift_ - to_rear.abs();
    const Lanes to_right = (shift_left_ * (left - now_left)).max(-room).min(room);
    const Lanes on_axle[2] = {-to_rear, to_rear}, on_side[2] = {-to_right, to_right};
    for (int i = 0; i < 2; ++i) {
      const Lanes slip_left = left + rate * axle_[i];
      const Lanes square_left = slip_left * slip_left + kCreep * kCreep;
      for (int j = 0; j < 2; ++j) {
        const Lanes slip_ahead = ahead - rate * side_[j] - wheels[j];
        const Lanes grip = grip_[i][j] + on_axle[i] + on_side[j];
        const Lanes square_ahead = slip_ahead * slip_ahead;
        Lanes viscous, viscous_left;
        if constexpr (pyramid) {
          viscous = grip / (square_ahead + kCreep * kCreep).sqrt();
          viscous_left = grip / square_left.sqrt();
        } else {
          viscous = viscous_left = grip / (square_ahead + square_left).sqrt();
        }
        const Lanes viscous_y = viscous * side_[j];
        drag += viscous;
        drag_left += viscous_left;
        drag_y += viscous_y;
        drag_x += viscous_left * axle_[i];
        moment += viscous_y * side_[j] + viscous_left * (axle_[i] * axle_[i]);
        push += viscous * wheels[j];
        push_y += viscous_y * wheels[j];
      }
    }
    // heavy ahead - drag_y rate = push_ahead, heavy_left left + drag_x rate = push_left,
    // (inertia + moment) rate - drag_y ahead + drag_x left = push_turn.
    const Lanes heavy = mass_ + drag, heavy_left = mass_ + drag_left;
    const Lanes push_ahead = mass_ * now_ahead + push, push_left = mass_ * now_left;
    const Lanes push_turn = inertia_ * now_rate - push_y;
    const Lanes both = heavy * heavy_left;
    rate = (push_turn * both + drag_y * push_ahead * heavy_left - drag_x * push_left * heavy) /
           ((inertia_ + moment) * both - drag_y * drag_y * heavy_left - drag_x * drag_x * heavy);
    ahead = (push_ahead + drag_y * rate) / heavy;
    left = (push_left - drag_x * rate) / heavy_left;
  }
  m.ahead = ahead;
  m.left = left;
  m.yaw_rate = rate;
}

}  // namespace slalom::planners
