#include "sim/robot.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "sim/mass_distribution.h"

namespace slalom::sim {
namespace {

constexpr float kClearanceLimit = 0.3f;    // How far ahead clearance is looked for, [m].
constexpr float kClearanceMargin = 1e-3f;  // Far above all rounding, [m].
constexpr float kTravel = 0.5f;            // More than the robot drives in a control step, [m].

}  // namespace

Robot::Robot(const RobotConfig& config, int num_substeps, Stepping stepping)
    : footprint_(MakeFootprint(config)),
      centre_x_(static_cast<float>(DistributeMass(config).x)),
      centre_y_(static_cast<float>(DistributeMass(config).y)),
      reach_(footprint_.Circumradius() + std::abs(centre_x_) + std::abs(centre_y_)),
      dt_(1.0 / config.control_rate),
      skid_steering_(config.drive == DriveKind::kSkidSteer
                         ? std::optional<SkidSteering>({config, dt_})
                         : std::nullopt),
      num_substeps_(num_substeps),
      stepping_(stepping),
      controller_(config, num_substeps),
      contacts_(std::make_shared<ContactWorld>(config)) {}

void Robot::Reserve(int num_moving) {
  moving_.reserve(num_moving);
  moving_shapes_.reserve(num_moving);
}

void Robot::Reset(const base::Pose2& X_WR, std::uint64_t seed) {
  body_ = {.x = static_cast<float>(X_WR.p.x),
           .y = static_cast<float>(X_WR.p.y),
           .yaw = static_cast<float>(X_WR.yaw)};
  centre_ = body_;
  const auto [s, c] = base::SinCos(body_.yaw);
  centre_.x += static_cast<float>(c * centre_x_ - s * centre_y_);
  centre_.y += static_cast<float>(s * centre_x_ + c * centre_y_);
  slip_ = {};
  controller_.Reset(seed);
  clearance_ = 0.0f;
  if (!skid_steering_ || !skid_steering_->needs_angles()) return;
  base::Random random(base::DeriveSeed(seed, "wheel angles"));
  for (float& angle : slip_.angles) {
    angle = static_cast<float>(random.Uniform(-0.5 * base::kPi, 0.5 * base::kPi));
  }
}

void Robot::TurnWheelsTo(double angle) {
  const double half_turns = std::floor(angle / base::kPi + 0.5);
  slip_.angles.fill(static_cast<float>(angle - half_turns * base::kPi));
}

bool Robot::Drive(double linear, double angular, const Scene& scene, double motion_time) {
  Order order{this, &scene, linear, angular, motion_time};
  DriveTogether({&order, 1});
  return order.touched;
}

void Robot::DriveTogether(std::span<Order> orders) {
  while (!orders.empty()) {
    const int count = static_cast<int>(std::min<std::size_t>(orders.size(), SkidLanes::kSize));
    std::array<Robot*, SkidLanes::kSize> robots{};
    SkidLanes lanes;
    bool any_slips = false;
    for (int i = 0; i < count; ++i) {
      robots[i] = static_cast<Robot*>(orders[i].robot);
      any_slips = any_slips || robots[i]->skid_steering_;
      robots[i]->Begin(orders[i], lanes, i);
      orders[i].touched = robots[i]->Touches();
    }
    for (int substep = 0; substep < num_substeps_; ++substep) {
      for (int i = 0; i < count; ++i) robots[i]->TurnWheels(substep, lanes, i);
      if (any_slips) lanes.Step();
      for (int i = 0; i < count; ++i) {
        robots[i]->Move(substep, orders[i], lanes, i);
        orders[i].touched = orders[i].touched || robots[i]->Touches();
      }
    }
    for (int i = 0; i < count; ++i) robots[i]->End(lanes, i);
    orders = orders.subspan(count);
  }
}

void Robot::Begin(const Order& order, SkidLanes& lanes, int lane) {
  controller_.Push(order.linear, order.angular);
  centre_.yaw = static_cast<float>(base::WrapAngle(centre_.yaw));
  if (clearance_ < kClearanceMargin) LookAround(order.scene->collision_map());
  const MovingObstacles& moving = order.scene->moving_obstacles();
  FindMoving(moving, order.motion_time, num_substeps_ * dt_);
  PlaceMoving(moving, order.motion_time);
  if (!skid_steering_) return;
  skid_steering_->Enter(lanes, lane);
  lanes.ahead[lane] = slip_.ahead;
  lanes.left[lane] = slip_.left;
  lanes.yaw_rate[lane] = slip_.yaw_rate;
  lanes.ahead_before[lane] = slip_.ahead_before;
  lanes.left_before[lane] = slip_.left_before;
  lanes.yaw_rate_before[lane] = slip_.yaw_rate_before;
  lanes.turn[lane] = slip_.turn;
  for (int wheel = 0; wheel < 4; ++wheel) lanes.angles[wheel][lane] = slip_.angles[wheel];
}

// One tick of the velocity controller.
void Robot::TurnWheels(int substep, SkidLanes& lanes, int lane) {
  const DriveCommand wheels = controller_.Tick(substep);
  if (!skid_steering_) return MoveIdeally(wheels);
  const WheelSpeeds speeds = skid_steering_->Wheels(wheels.linear, wheels.angular);
  lanes.wheel_left[lane] = speeds.left;
  lanes.wheel_right[lane] = speeds.right;
  lanes.yaw[lane] = centre_.yaw;
}

void Robot::Move(int substep, const Order& order, SkidLanes& lanes, int lane) {
  if (skid_steering_) {
    centre_.vx = lanes.vx[lane];
    centre_.vy = lanes.vy[lane];
    centre_.yaw_rate = lanes.yaw_rate[lane];
  }
  const float dt = static_cast<float>(dt_);
  const CollisionMap& map = order.scene->collision_map();
  const bool in_contact = std::min(clearance_, moving_clearance_) < kClearanceMargin;
  if (in_contact || stepping_ == Stepping::kBox2dAlways) {
    if (contacts_->Step(map, moving_shapes_, dt, centre_)) {
      if (skid_steering_) {
        lanes.Resume(lane, centre_.yaw, centre_.vx, centre_.vy, centre_.yaw_rate, dt_);
      } else {  // Wheels that do not slip turn as the body goes.
        const auto [s, c] = base::SinCos(centre_.yaw);
        controller_.Force({c * centre_.vx + s * centre_.vy, centre_.yaw_rate});
      }
      clearance_ = 0.0f;  // The contact may have moved the body by more than its speed says.
    }
  } else {
    centre_.x += dt * centre_.vx;
    centre_.y += dt * centre_.vy;
    centre_.yaw += dt * centre_.yaw_rate;
  }
  // No point of the outline moved by more than this.
  clearance_ -= dt * (std::sqrt(centre_.vx * centre_.vx + centre_.vy * centre_.vy) +
                      std::abs(centre_.yaw_rate) * reach_);
  if (clearance_ < 2.0f * kClearanceMargin) LookAround(map);
  const MovingObstacles& moving = order.scene->moving_obstacles();
  if (moving.empty()) return;
  const double time = order.motion_time + (substep + 1) * dt_;
  const float gone_x = centre_.x - found_x_, gone_y = centre_.y - found_y_;
  if (gone_x * gone_x + gone_y * gone_y > kTravel * kTravel) {
    FindMoving(moving, time, (num_substeps_ - substep - 1) * dt_);
  }
  PlaceMoving(moving, time);
}

void Robot::End(const SkidLanes& lanes, int lane) {
  slip_ = {.ahead = lanes.ahead[lane],
           .left = lanes.left[lane],
           .yaw_rate = lanes.yaw_rate[lane],
           .ahead_before = lanes.ahead_before[lane],
           .left_before = lanes.left_before[lane],
           .yaw_rate_before = lanes.yaw_rate_before[lane],
           .turn = lanes.turn[lane],
           .angles = {}};
  for (int wheel = 0; wheel < 4; ++wheel) slip_.angles[wheel] = lanes.angles[wheel][lane];
  body_ = centre_;
  const FootprintPose X_WR = Outline();
  body_.vx += body_.yaw_rate * (centre_.y - X_WR.y);
  body_.vy -= body_.yaw_rate * (centre_.x - X_WR.x);
  body_.x = X_WR.x;
  body_.y = X_WR.y;
}

bool Robot::Touches() const { return std::min(clearance_, moving_clearance_) <= 0.0f; }

void Robot::LookAround(const CollisionMap& map) {
  clearance_ = map.Clearance(footprint_, Outline(), kClearanceLimit);
}

// Finds those that may come within kClearanceMargin from `time` on for `duration` [s].
void Robot::FindMoving(const MovingObstacles& moving, double time, double duration) {
  moving_.clear();
  found_x_ = centre_.x;
  found_y_ = centre_.y;
  for (int i = 0; i < moving.size(); ++i) {
    const PlacedBox& place = moving.At(i, time).box;
    const float dx = place.x - centre_.x, dy = place.y - centre_.y;
    const float far = moving.circumradius(i) + reach_ + kTravel +
                      static_cast<float>(duration) * moving.max_speed(i) + 2.0f * kClearanceMargin;
    if (dx * dx + dy * dy < far * far || moving.Jumps(i, time, duration)) moving_.push_back(i);
  }
}

void Robot::PlaceMoving(const MovingObstacles& moving, double time) {
  moving_shapes_.clear();
  moving_clearance_ = kClearanceLimit;
  if (moving_.empty()) return;
  const FootprintPose X_WR = Outline();
  for (const int i : moving_) {
    moving_shapes_.push_back(moving.At(i, time));
    moving_clearance_ =
        std::min(moving_clearance_, Clearance(moving_shapes_.back(), footprint_, X_WR));
  }
}

// The present pose of the outline.
FootprintPose Robot::Outline() const {
  FootprintPose X_WR = MakeFootprintPose(centre_.x, centre_.y, centre_.yaw);
  X_WR.x -= X_WR.cos_yaw * centre_x_ - X_WR.sin_yaw * centre_y_;
  X_WR.y -= X_WR.sin_yaw * centre_x_ + X_WR.cos_yaw * centre_y_;
  return X_WR;
}

base::Pose2 Robot::pose() const { return {{body_.x, body_.y}, base::WrapAngle(body_.yaw)}; }

// The body moves along the chord of its arc: in the direction that it has half-way through the
// step.
void Robot::MoveIdeally(const DriveCommand& wheels) {
  centre_.yaw_rate = static_cast<float>(wheels.angular);
  controller_.Force({wheels.linear, centre_.yaw_rate});
  const auto [s, c] = base::SinCos(centre_.yaw + 0.5 * dt_ * centre_.yaw_rate);
  centre_.vx = static_cast<float>(wheels.linear * c);
  centre_.vy = static_cast<float>(wheels.linear * s);
}

MakeRobotBodies MakeRobots(Robot::Stepping stepping) {
  return [stepping](const EnvironmentConfig& config,
                    std::span<const std::shared_ptr<const Scene>> scenes, int count) {
    int max_moving = 0;
    for (const auto& scene : scenes) {
      max_moving = std::max(max_moving, scene->moving_obstacles().size());
    }
    const Robot prototype(config.robot, NumSubsteps(config), stepping);
    std::vector<std::unique_ptr<RobotBody>> bodies;
    for (int i = 0; i < count; ++i) {
      auto robot = std::make_unique<Robot>(prototype);
      robot->Reserve(max_moving);
      bodies.push_back(std::move(robot));
    }
    return bodies;
  };
}

}  // namespace slalom::sim
