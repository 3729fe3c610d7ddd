#pragma once

#include <memory>
#include <utility>

#include "base/random.h"
#include "sim/courses/course.h"
#include "sim/courses/motion.h"

/// Moving obstacles for tests, and courses in which they are held still.

namespace slalom::test {

/// A copy of the course with `num_moving` obstacles added: boxes and cylinders, 2 to 5 key frames
/// within 4 m of the origin, up to about 2 m/s, looping or going back and forth.
inline std::shared_ptr<const sim::Course> WithMoving(const sim::Course& course, int num_moving,
                                                     base::Random& random) {
  sim::Course with = course;
  for (int i = 0; i < num_moving; ++i) {
    sim::MovingObstacle obstacle;
    if (random.Uniform() < 0.4) {
      obstacle.radius = random.Uniform(0.05, 0.4);
    } else {
      obstacle.half_size = {random.Uniform(0.05, 0.8), random.Uniform(0.05, 0.3)};
    }
    double time = 0.0;
    const int num_frames = 2 + static_cast<int>(random.UniformInt(4));
    for (int k = 0; k < num_frames; ++k) {
      obstacle.key_frames.push_back(
          {time,
           {{random.Uniform(-4.0, 4.0), random.Uniform(-4.0, 4.0)}, random.Uniform(-3.0, 3.0)}});
      time += random.Uniform(2.0, 6.0);
    }
    obstacle.playback = random.Uniform() < 0.6 ? sim::Playback::kLoop : sim::Playback::kPingPong;
    with.moving.push_back(std::move(obstacle));
  }
  return std::make_shared<const sim::Course>(std::move(with));
}

/// The course at motion time `time` [s], its moving obstacles as fixed ones.
inline sim::Course Frozen(const sim::Course& course, double time) {
  sim::Course frozen = course;
  frozen.moving.clear();
  for (const sim::MovingObstacle& obstacle : course.moving) {
    const base::Pose2 X_WB = sim::Motion(obstacle).At(time).X_WB;
    if (obstacle.radius > 0.0) {
      frozen.circles.push_back({X_WB.p, obstacle.radius});
    } else {
      frozen.boxes.push_back({X_WB, obstacle.half_size});
    }
  }
  return frozen;
}

}  // namespace slalom::test
