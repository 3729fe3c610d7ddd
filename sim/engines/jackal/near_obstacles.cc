#include "sim/engines/jackal/near_obstacles.h"

#include <algorithm>

namespace slalom::engines {
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

}  // namespace slalom::engines
