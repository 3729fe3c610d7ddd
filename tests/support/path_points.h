#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "base/geometry.h"
#include "sim/courses/course.h"

namespace slalom::test {

/// Start, reference path and goal, a point every `spacing` [m] at least.
inline std::vector<base::Vec2> PathPoints(const sim::Course& course, double spacing) {
  std::vector<base::Vec2> corners = {course.start.p};
  corners.insert(corners.end(), course.reference_path_W.begin(), course.reference_path_W.end());
  corners.push_back(course.goal_W);
  std::vector<base::Vec2> points;
  for (std::size_t i = 1; i < corners.size(); ++i) {
    const base::Vec2 step = corners[i] - corners[i - 1];
    const int n = static_cast<int>(std::ceil(base::Norm(step) / spacing));
    for (int k = 0; k < n; ++k) points.push_back(corners[i - 1] + (1.0 * k / n) * step);
  }
  points.push_back(course.goal_W);
  return points;
}

}  // namespace slalom::test
