#pragma once

#include <span>
#include <utility>
#include <vector>

#include "sim/collision_map.h"
#include "sim/moving_obstacles.h"
#include "sim/robot_body.h"
#include "sim/scene.h"

namespace slalom::engines {

/// Finds the obstacles that a robot may touch within a step of an engine: those within 5 cm of its
/// outline. Thread-compatible.
class NearObstacles {
 public:
  /// Finds at most `max_obstacles`, the nearest.
  NearObstacles(const sim::Footprint& footprint, int max_obstacles);

  /// Returns the obstacles near the robot at motion time `time` [s]; fixed obstacles have speed 0.
  /// The order depends on the arguments alone. Valid until the next call.
  std::span<const sim::MovingShape> Find(const sim::Scene& scene, double time,
                                         const sim::BodyState& robot);

 private:
  void Consider(const sim::MovingShape& shape, const sim::FootprintPose& X_WR);

  struct Candidate {
    float clearance = 0.0f;  // [m]
    sim::MovingShape shape;
  };

  const sim::Footprint footprint_;
  const std::size_t max_obstacles_;
  std::vector<Candidate> candidates_;
  std::vector<sim::MovingShape> found_;
};

}  // namespace slalom::engines
