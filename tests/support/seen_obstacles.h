#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "base/geometry.h"
#include "env/sensing/obstacle_tracker.h"
#include "env/sensing/scan.h"
#include "sim/moving_obstacles.h"
#include "tests/support/scan_walk.h"

namespace slalom::test {

/// The moving obstacles that a walk's scans show, as they truly are.
class SeenObstacles {
 public:
  struct Obstacle {
    base::Vec2 p_O, v_O;  ///< [m], [m/s].
    double radius = 0.0;  ///< Of the circle round it, [m].
    int num_scans = 0;    ///< In turn, up to this one, that showed it; 0: it is not seen.
  };

  static constexpr int kLeastBeams = 5;  ///< That show an obstacle.

  explicit SeenObstacles(const ScanWalk& walk)
      : walk_(walk),
        projector_(walk.geometry()),
        obstacles_(static_cast<std::size_t>(walk.scene().moving_obstacles().size())) {}

  /// Takes the walk's newest scan.
  void Look() {
    const sim::MovingObstacles& moving = walk_.scene().moving_obstacles();
    const base::Pose2 &start = walk_.scene().course().start, &X_WR = walk_.pose();
    env::ScanRays rays_W;
    projector_.Project(walk_.ranges_cm(), X_WR, rays_W);
    for (std::size_t i = 0; i < obstacles_.size(); ++i) {
      const int index = static_cast<int>(i);
      const sim::MovingShape shape = moving.At(index, walk_.time());
      const base::Pose2 X_WB{{shape.box.x, shape.box.y}, shape.box.yaw};
      const auto num_beams = std::ranges::count_if(rays_W.rays, [&](const env::ScanRay& ray) {
        if (!ray.hit) return false;
        const base::Vec2 p_B = base::InverseTransform(X_WB, ray.p_O);
        if (shape.radius > 0.0f) return std::abs(base::Norm(p_B) - shape.radius) < kNear;
        const double x = std::abs(p_B.x) - shape.box.half_x, y = std::abs(p_B.y) - shape.box.half_y;
        return x < kNear && y < kNear && std::max(x, y) > -kNear;
      });
      Obstacle& obstacle = obstacles_[i];
      const base::Pose2 axes{{}, start.yaw};
      obstacle.v_O = base::InverseTransform(axes, {shape.vx, shape.vy});
      const base::Vec2 p_O = base::InverseTransform(start, X_WB.p);
      // One that jumps back to where it began is another.
      const bool goes_on = base::Norm(p_O - obstacle.p_O) < 1.0;
      obstacle.p_O = p_O;
      obstacle.radius = moving.circumradius(index);
      obstacle.num_scans = num_beams < kLeastBeams ? 0 : goes_on ? obstacle.num_scans + 1 : 1;
    }
  }

  std::span<const Obstacle> obstacles() const { return obstacles_; }

 private:
  static constexpr double kNear = 0.08;  // More than the noise, [m].

  const ScanWalk& walk_;
  const env::ScanProjector projector_;
  std::vector<Obstacle> obstacles_;
};

/// How tracks differ from the truth, as sums.
struct TrackingErrors {
  double num_obstacles = 0.0, num_missed = 0.0, num_found = 0.0, num_tracks = 0.0, num_false = 0.0;
  double place = 0.0, velocity = 0.0, speed = 0.0;  ///< Of those found, [m], [m/s].

  /// An obstacle is to be found once it was seen in `least_scans` scans.
  void Add(const SeenObstacles& seen, const ScanWalk& walk, std::span<const env::Track> tracks,
           int least_scans = 3) {
    // The tracker's frame drifts with the odometry.
    const base::Pose2 X_OR = walk.odometry(), truth = walk.truth();
    const auto drifted = [&](base::Vec2 p_O) {
      return base::Transform(X_OR, base::InverseTransform(truth, p_O));
    };
    for (const env::Track& track : tracks) {
      ++num_tracks;
      num_false += std::ranges::none_of(seen.obstacles(), [&](const auto& obstacle) {
        return base::Norm(track.p_O - drifted(obstacle.p_O)) < obstacle.radius + 0.3;
      });
    }
    for (const SeenObstacles::Obstacle& obstacle : seen.obstacles()) {
      if (obstacle.num_scans < least_scans) continue;
      ++num_obstacles;
      const env::Track* nearest = nullptr;
      double least = obstacle.radius + 0.3;
      for (const env::Track& track : tracks) {
        const double distance = base::Norm(track.p_O - drifted(obstacle.p_O));
        if (distance < least) least = distance, nearest = &track;
      }
      if (nearest == nullptr) {
        ++num_missed;
        continue;
      }
      ++num_found;
      place += least;
      velocity += base::Norm(nearest->v_O - obstacle.v_O);
      speed += base::Norm(obstacle.v_O);
    }
  }
};

}  // namespace slalom::test
