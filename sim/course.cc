#include "sim/course.h"

namespace slalom::sim {

double ReferenceLength(const Course& course) {
  double length = 0.0;
  base::Vec2 last = course.start.p;
  for (const base::Vec2& point : course.reference_path_W) {
    length += base::Norm(point - last);
    last = point;
  }
  return length + base::Norm(course.goal_W - last);
}

}  // namespace slalom::sim
