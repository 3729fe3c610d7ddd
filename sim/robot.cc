#include "sim/robot.h"

#include <algorithm>
#include <cmath>

namespace slalom::sim {
namespace {

constexpr float kClearanceLimit = 0.3f;    // How far ahead clearance is looked for, [m].
constexpr float kClearanceMargin = 1e-3f;  // Far above all rounding, [m].
constexpr float kTravel = 0.5f;            // More than the robot drives in a control step, [m].

}  // namespace

Robot::Robot(const RobotConfig& config, int num_substeps, Stepping stepping)
    : footprint_(MakeFootprint(config)),
      dt_(1.0 / config.control_rate),
      skid_steering_(config.drive == DriveKind::kSkidSteer
                         ? std::optional<SkidSteering>({config, dt_})
                         : std::nullopt),
      num_substeps_(num_substeps),
      stepping_(stepping),
      controller_(config, num_substeps) {}

void Robot::Reserve(int num_moving) {
  moving_.reserve(num_moving);
  moving_shapes_.reserve(num_moving);
}

void Robot::Reset(const base::Pose2& X_WR, std::uint64_t seed) {
  body_ = {.x = static_cast<float>(X_WR.p.x),
           .y = static_cast<float>(X_WR.p.y),
           .yaw = static_cast<float>(X_WR.yaw)};
  controller_.Reset(seed);
  clearance_ = 0.0f;
}

bool Robot::Drive(double linear, double angular, const Scene& scene, double motion_time,
                  ContactWorld& contacts) {
  controller_.Push(linear, angular);
  body_.yaw = static_cast<float>(base::WrapAngle(body_.yaw));
  const float dt = static_cast<float>(dt_);
  const CollisionMap& map = scene.collision_map();
  const MovingObstacles& moving = scene.moving_obstacles();
  const auto look_around = [&] {
    clearance_ = map.Clearance(footprint_, body_.x, body_.y, body_.yaw, kClearanceLimit);
  };
  if (clearance_ < kClearanceMargin) look_around();
  FindMoving(moving, motion_time, num_substeps_ * dt_);
  PlaceMoving(moving, motion_time);
  bool touched = std::min(clearance_, moving_clearance_) <= 0.0f;
  for (int substep = 0; substep < num_substeps_; ++substep) {
    const DriveCommand wheels = controller_.Tick(substep);
    if (skid_steering_) {
      MoveWithSlip(wheels);
    } else {
      MoveIdeally(wheels);
    }
    const bool in_contact = std::min(clearance_, moving_clearance_) < kClearanceMargin;
    if (in_contact || stepping_ == Stepping::kBox2dAlways) {
      if (contacts.Step(map, moving_shapes_, dt, body_)) {
        if (!skid_steering_) {  // Wheels that do not slip turn as the body goes.
          const auto [s, c] = base::SinCos(body_.yaw);
          controller_.Force({c * body_.vx + s * body_.vy, body_.yaw_rate});
        }
        clearance_ = 0.0f;  // The contact may have moved the body by more than its speed says.
      }
    } else {
      body_.x += dt * body_.vx;
      body_.y += dt * body_.vy;
      body_.yaw += dt * body_.yaw_rate;
    }
    // No point of the outline moved by more than this.
    clearance_ -= dt * (std::sqrt(body_.vx * body_.vx + body_.vy * body_.vy) +
                        std::abs(body_.yaw_rate) * footprint_.Circumradius());
    if (clearance_ < 2.0f * kClearanceMargin) look_around();
    if (!moving.empty()) {
      const double time = motion_time + (substep + 1) * dt_;
      const float gone_x = body_.x - found_x_, gone_y = body_.y - found_y_;
      if (gone_x * gone_x + gone_y * gone_y > kTravel * kTravel) {
        FindMoving(moving, time, (num_substeps_ - substep - 1) * dt_);
      }
      PlaceMoving(moving, time);
    }
    touched = touched || std::min(clearance_, moving_clearance_) <= 0.0f;
  }
  return touched;
}

// Finds those that may come within kClearanceMargin from `time` on for `duration` [s].
void Robot::FindMoving(const MovingObstacles& moving, double time, double duration) {
  moving_.clear();
  found_x_ = body_.x;
  found_y_ = body_.y;
  for (int i = 0; i < moving.size(); ++i) {
    const PlacedBox& place = moving.At(i, time).box;
    const float dx = place.x - body_.x, dy = place.y - body_.y;
    const float far = moving.circumradius(i) + footprint_.Circumradius() + kTravel +
                      static_cast<float>(duration) * moving.max_speed(i) + 2.0f * kClearanceMargin;
    if (dx * dx + dy * dy < far * far || moving.Jumps(i, time, duration)) moving_.push_back(i);
  }
}

void Robot::PlaceMoving(const MovingObstacles& moving, double time) {
  moving_shapes_.clear();
  moving_clearance_ = kClearanceLimit;
  if (moving_.empty()) return;
  const FootprintPose X_WR = MakeFootprintPose(body_.x, body_.y, body_.yaw);
  for (const int i : moving_) {
    moving_shapes_.push_back(moving.At(i, time));
    moving_clearance_ =
        std::min(moving_clearance_, Clearance(moving_shapes_.back(), footprint_, X_WR));
  }
}

base::Pose2 Robot::pose() const { return {{body_.x, body_.y}, base::WrapAngle(body_.yaw)}; }

// The body moves along the chord of its arc: in the direction that it has half-way through the
// step.
void Robot::MoveIdeally(const DriveCommand& wheels) {
  body_.yaw_rate = static_cast<float>(wheels.angular);
  controller_.Force({wheels.linear, body_.yaw_rate});
  const auto [s, c] = base::SinCos(body_.yaw + 0.5 * dt_ * body_.yaw_rate);
  body_.vx = static_cast<float>(wheels.linear * c);
  body_.vy = static_cast<float>(wheels.linear * s);
}

// Wheels point where they do half-way through the step. A body in a steady turn had the same
// velocity in their frame a step ago, a turn of yaw_rate x dt back (to second order).
void Robot::MoveWithSlip(const DriveCommand& wheels) {
  const auto sin_cos = base::SinCos(body_.yaw + 0.5 * dt_ * body_.yaw_rate);
  const float s = static_cast<float>(sin_cos.sin), c = static_cast<float>(sin_cos.cos);
  const BodyVelocity now{c * body_.vx + s * body_.vy, c * body_.vy - s * body_.vx, body_.yaw_rate};
  const float turn = static_cast<float>(dt_) * body_.yaw_rate;
  const float cos_turn = 1.0f - 0.5f * turn * turn;
  const BodyVelocity before{cos_turn * now.ahead - turn * now.left,
                            cos_turn * now.left + turn * now.ahead, now.yaw_rate};
  const BodyVelocity v =
      skid_steering_->Step(now, before, skid_steering_->Wheels(wheels.linear, wheels.angular));
  body_.vx = c * v.ahead - s * v.left;
  body_.vy = s * v.ahead + c * v.left;
  body_.yaw_rate = v.yaw_rate;
}

}  // namespace slalom::sim
