#include "sim/engines/jackal/engine_body.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/mutex.h"
#include "base/random.h"
#include "sim/contact_world.h"
#include "sim/courses/course.h"
#include "sim/courses/motion.h"

namespace slalom::engines {
namespace {

constexpr double kStep = 1e-3;       // Approximate duration of an engine's step, [s].
constexpr double kMostLift = 0.1;    // [m]
constexpr double kFastest = 20.0;    // Highest speed of obstacles, 2 cm in a step, [m/s].
constexpr double kThinnest = 0.002;  // Least width of obstacles, [m].

void RequireThick(const std::string& course, std::string_view physics, const char* what,
                  std::size_t index, double size) {
  if (size >= kThinnest) return;
  throw base::Error("course '{}': {} {} is {} m wide; physics {} takes obstacles of {} m and more",
                    course, what, index, size, physics, kThinnest);
}

/// `index` of obstacles: in the order of the course's file, from 0.
void RequireRepresentable(const sim::Course& course, std::string_view physics) {
  for (std::size_t i = 0; i < course.circles.size(); ++i) {
    RequireThick(course.name, physics, "circle", i, 2.0 * course.circles[i].radius);
  }
  for (std::size_t i = 0; i < course.boxes.size(); ++i) {
    const base::Vec2 half = course.boxes[i].half_size;
    RequireThick(course.name, physics, "box", i, 2.0 * std::min(half.x, half.y));
  }
  for (std::size_t i = 0; i < course.moving.size(); ++i) {
    const sim::MovingObstacle& moving = course.moving[i];
    const double half =
        moving.radius > 0.0 ? moving.radius : std::min(moving.half_size.x, moving.half_size.y);
    RequireThick(course.name, physics, "moving obstacle", i, 2.0 * half);
    const sim::Motion motion(moving);
    const double reach = moving.radius > 0.0 ? 0.0 : base::Norm(moving.half_size);
    const double speed = motion.max_speed() + motion.max_yaw_rate() * reach;
    if (speed <= kFastest) continue;
    throw base::Error(
        "course '{}': moving obstacle {} goes at up to {:.1f} m/s; physics {} takes obstacles of "
        "at most {} m/s",
        course.name, i, speed, physics, kFastest);
  }
}

}  // namespace

namespace {

constexpr float kMargin = 0.05f;  // More than anything moves in a step of an engine, [m].

}  // namespace

NearObstacles::NearObstacles(const sim::Footprint& footprint, int max_obstacles)
    : footprint_(footprint), max_obstacles_(static_cast<std::size_t>(max_obstacles)) {
  found_.reserve(max_obstacles_);
}

std::span<const sim::MovingShape> NearObstacles::Find(const sim::Scene& scene, double time,
                                                      const sim::BodyState& robot) {
  candidates_.clear();
  const sim::FootprintPose X_WR = sim::MakeFootprintPose(robot.x, robot.y, robot.yaw);
  const sim::CollisionMap& map = scene.collision_map();
  sim::CollisionMap::Runs runs;
  map.FindCircles(robot.x, robot.y, footprint_.Circumradius() + kMargin, runs);
  for (const sim::CollisionMap::Run& run : runs.span()) {
    for (int i = run.begin; i < run.end; ++i) {
      sim::MovingShape circle;
      circle.box.x = map.x()[i];
      circle.box.y = map.y()[i];
      circle.radius = map.radius()[i];
      Consider(circle, X_WR);
    }
  }
  for (const sim::PlacedBox& box : map.boxes()) Consider({.box = box}, X_WR);
  const sim::MovingObstacles& moving = scene.moving_obstacles();
  for (int i = 0; i < moving.size(); ++i) Consider(moving.At(i, time), X_WR);
  if (candidates_.size() > max_obstacles_) {
    std::ranges::stable_sort(candidates_, {}, &Candidate::clearance);
    candidates_.resize(max_obstacles_);
  }
  found_.clear();
  for (const Candidate& candidate : candidates_) found_.push_back(candidate.shape);
  return found_;
}

void NearObstacles::Consider(const sim::MovingShape& shape, const sim::FootprintPose& X_WR) {
  const float clearance = sim::Clearance(shape, footprint_, X_WR);
  if (clearance < kMargin) candidates_.push_back({clearance, shape});
}

EngineBody::EngineBody(const sim::RobotConfig& config, int num_ticks, std::unique_ptr<World> world)
    : num_ticks_(num_ticks),
      steps_per_tick_(StepsPerTick(config)),
      step_(StepOf(config)),
      steering_(config, 1.0 / config.control_rate),
      controller_(config, num_ticks),
      near_(sim::MakeFootprint(config), kMaxNearObstacles),
      world_(std::move(world)) {
  SLALOM_CHECK(world_ != nullptr);
}

int EngineBody::StepsPerTick(const sim::RobotConfig& config) {
  return std::max(1, static_cast<int>(std::lround(1.0 / (config.control_rate * kStep))));
}

double EngineBody::StepOf(const sim::RobotConfig& config) {
  return 1.0 / (config.control_rate * StepsPerTick(config));
}

void EngineBody::Reset(const base::Pose2& X_WR, std::uint64_t seed) {
  controller_.Reset(seed);
  base::Random random(base::DeriveSeed(seed, "wheel angles"));
  WheelAngles angles;
  for (double& angle : angles) angle = random.Uniform(-0.5 * base::kPi, 0.5 * base::kPi);
  world_->Reset(X_WR, angles);
  state_ = world_->state();
}

bool EngineBody::Drive(double linear, double angular, const sim::Scene& scene, double motion_time) {
  controller_.Push(linear, angular);
  bool touched = false;
  for (int tick = 0; tick < num_ticks_; ++tick) {
    const sim::DriveCommand demand = controller_.Tick(tick);
    const sim::WheelSpeeds wheels = steering_.Wheels(demand.linear, demand.angular);
    for (int k = 0; k < steps_per_tick_; ++k) {
      const double time = motion_time + (tick * steps_per_tick_ + k) * step_;
      if (world_->Step(wheels, near_.Find(scene, time, state_))) touched = true;
      state_ = world_->state();
    }
  }
  return touched || world_->lift() > kMostLift;
}

base::Pose2 EngineBody::pose() const { return {{state_.x, state_.y}, base::WrapAngle(state_.yaw)}; }

sim::MakeRobotBodies BodiesIn(std::string_view physics, MakeWorlds make_worlds) {
  return [physics = std::string(physics), make_worlds = std::move(make_worlds),
          mutex = std::make_shared<base::Mutex>()](
             const sim::EnvironmentConfig& config,
             std::span<const std::shared_ptr<const sim::Scene>> scenes, int count) {
    for (const auto& scene : scenes) RequireRepresentable(scene->course(), physics);
    const sim::RobotConfig& robot = config.robot;
    const base::MutexLock lock(*mutex);  // Engines build one model at a time.
    auto worlds = make_worlds(MakeJackal(robot, physics), EngineBody::StepOf(robot), count);
    std::vector<std::unique_ptr<sim::RobotBody>> bodies;
    bodies.reserve(worlds.size());
    for (auto& world : worlds) {
      bodies.push_back(
          std::make_unique<EngineBody>(robot, sim::NumSubsteps(config), std::move(world)));
    }
    return bodies;
  };
}

}  // namespace slalom::engines
