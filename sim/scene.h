#pragma once

#include <memory>
#include <vector>

#include "sim/collision_map.h"
#include "sim/courses/course.h"
#include "sim/moving_obstacles.h"

namespace slalom::sim {

/// A course made ready for driving: its data, and its obstacles laid out for the LiDAR and the
/// collision test. Immutable, so all environments and threads share one.
class Scene {
 public:
  /// Requires: course is not null.
  explicit Scene(std::shared_ptr<const Course> course);

  const Course& course() const { return *course_; }
  const CollisionMap& collision_map() const { return collision_map_; }
  const MovingObstacles& moving_obstacles() const { return moving_obstacles_; }

 private:
  std::shared_ptr<const Course> course_;
  CollisionMap collision_map_;
  MovingObstacles moving_obstacles_;
};

std::shared_ptr<const Scene> MakeScene(std::shared_ptr<const Course> course);

/// The scenes of all courses of the set, in its order.
std::vector<std::shared_ptr<const Scene>> MakeScenes(const CourseSet& set);

}  // namespace slalom::sim
