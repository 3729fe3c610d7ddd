#include "sim/scene.h"

#include <utility>

#include "base/check.h"

namespace slalom::sim {

Scene::Scene(std::shared_ptr<const Course> course)
    : course_(std::move(course)), collision_map_(*course_), moving_obstacles_(*course_) {}

std::shared_ptr<const Scene> MakeScene(std::shared_ptr<const Course> course) {
  SLALOM_CHECK(course != nullptr);
  return std::make_shared<const Scene>(std::move(course));
}

std::vector<std::shared_ptr<const Scene>> MakeScenes(const CourseSet& set) {
  std::vector<std::shared_ptr<const Scene>> scenes;
  scenes.reserve(set.courses.size());
  for (const auto& course : set.courses) scenes.push_back(MakeScene(course));
  return scenes;
}

}  // namespace slalom::sim
