#include "sim/courses/course_overlap.h"

#include <algorithm>
#include <cstdint>
#include <set>
#include <span>
#include <vector>

#include "base/file.h"

namespace slalom::sim {
namespace {

/// An obstacle's numbers. The first says what kind it is.
using Numbers = std::vector<double>;

Numbers NumbersOf(const MovingObstacle& obstacle) {
  Numbers numbers = {2.0, obstacle.radius, obstacle.half_size.x, obstacle.half_size.y,
                     static_cast<double>(obstacle.playback)};
  for (const KeyFrame& frame : obstacle.key_frames) {
    numbers.insert(numbers.end(), {frame.time, frame.X_WB.p.x, frame.X_WB.p.y, frame.X_WB.yaw});
  }
  return numbers;
}

/// A checksum of the obstacles that does not depend on their order.
std::uint64_t ObstacleChecksum(const Course& course) {
  std::vector<Numbers> obstacles;
  for (const Circle& c : course.circles) obstacles.push_back({0.0, c.p_W.x, c.p_W.y, c.radius});
  for (const Box& box : course.boxes) {
    obstacles.push_back(
        {1.0, box.X_WB.p.x, box.X_WB.p.y, box.X_WB.yaw, box.half_size.x, box.half_size.y});
  }
  for (const MovingObstacle& moving : course.moving) obstacles.push_back(NumbersOf(moving));
  std::ranges::sort(obstacles);
  std::uint64_t checksum = 0;
  for (Numbers& numbers : obstacles) {
    for (double& number : numbers) number += 0.0;  // Makes 0 of -0.
    checksum = base::Checksum(std::as_bytes(std::span(numbers)), checksum);
  }
  return checksum;
}

}  // namespace

int CountSharedCourses(const CourseSet& scored, const CourseSet& trained) {
  std::set<std::uint64_t> seen;
  for (const auto& course : trained.courses) seen.insert(ObstacleChecksum(*course));
  return static_cast<int>(std::ranges::count_if(scored.courses, [&](const auto& course) {
    return seen.contains(ObstacleChecksum(*course));
  }));
}

}  // namespace slalom::sim
