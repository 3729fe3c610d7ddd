#pragma once

#include <memory>

#include "base/random.h"
#include "sim/courses/course.h"

/// Small courses for tests that must not change when the generators do.

namespace slalom::test {

struct RandomCourseOptions {
  int num_circles = 60;
  int num_boxes = 0;
  double max_radius = 0.3;   ///< Radii are uniform from 0.05 m to this.
  double clear_start = 0.5;  ///< No obstacle comes nearer to the start than this, [m].
};

/// Obstacles scattered over 8 x 8 m around the origin; start at the origin heading along +x, goal
/// at (6, 0).
inline std::shared_ptr<const sim::Course> RandomCourse(base::Random& random,
                                                       const RandomCourseOptions& options = {}) {
  sim::Course course;
  course.name = "random";
  course.goal_W = {6.0, 0.0};
  course.bounds = {{-4.0, -4.0}, {4.0, 4.0}};
  const auto draw_center = [&] {
    return base::Vec2{random.Uniform(-4.0, 4.0), random.Uniform(-4.0, 4.0)};
  };
  while (static_cast<int>(course.circles.size()) < options.num_circles) {
    const sim::Circle circle{draw_center(), random.Uniform(0.05, options.max_radius)};
    if (base::Norm(circle.p_W) > circle.radius + options.clear_start)
      course.circles.push_back(circle);
  }
  while (static_cast<int>(course.boxes.size()) < options.num_boxes) {
    const sim::Box box{{draw_center(), random.Uniform(-4.0, 4.0)},
                       {random.Uniform(0.05, 1.0), random.Uniform(0.05, 0.4)}};
    if (base::Norm(box.X_WB.p) > base::Norm(box.half_size) + options.clear_start) {
      course.boxes.push_back(box);
    }
  }
  return std::make_shared<const sim::Course>(std::move(course));
}

}  // namespace slalom::test
