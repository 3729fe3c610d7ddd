#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/geometry.h"
#include "base/random.h"
#include "env/sensing/scan.h"
#include "sim/courses/course.h"
#include "sim/lidar.h"
#include "sim/localisation.h"
#include "sim/scene.h"

namespace slalom::test {

/// What a robot senses that walks along a course's reference path to its goal, 0.25 m in each step
/// of 0.2 s: a range finder and an odometry as noisy as in configs/real-robot.toml.
class ScanWalk {
 public:
  static constexpr double kStep = 0.2;  ///< [s]
  static constexpr sim::LocalisationConfig kDrift = {
      .position_drift = 0.02, .heading_drift = 0.003, .turn_drift = 0.01};

  explicit ScanWalk(const sim::Course& course, std::uint64_t seed, int num_beams = 720,
                    const sim::LocalisationConfig& drift = kDrift)
      : scene_(sim::MakeScene(std::make_shared<sim::Course>(course))),
        poses_W_(Poses(course)),
        lidar_({.num_beams = num_beams,
                .noise_std = 0.02,
                .noise_per_metre = 0.002,
                .dropout_probability = 0.01},
               kClip),
        noise_(seed),
        localisation_(drift),
        ranges_cm_(static_cast<std::size_t>(num_beams)) {
    localisation_.Reset(course.start, seed);
  }

  env::ScanGeometry geometry() const {
    return {.num_beams = lidar_.num_beams(), .p_RS = lidar_.mounting(), .clip = kClip};
  }

  /// Takes the next step; false at the goal.
  bool Step() {
    if (step_ == poses_W_.size()) return false;
    const base::Pose2& X_WR = poses_W_[step_];
    way_ += base::Norm(X_WR.p - poses_W_[step_ == 0 ? 0 : step_ - 1].p);
    localisation_.Advance(X_WR, 0.0);
    ++step_;
    scene_->moving_obstacles().PlaceAll(time(), moving_);
    lidar_.Scan(scene_->collision_map(), X_WR, noise_, ranges_cm_, &moving_);
    return true;
  }

  double way() const { return way_; }                                 ///< So far, [m].
  double time() const { return kStep * static_cast<double>(step_); }  ///< Of what moves, [s].
  const sim::Scene& scene() const { return *scene_; }
  const base::Pose2& pose() const { return poses_W_[step_ - 1]; }  ///< X_WR
  std::span<const std::uint16_t> ranges_cm() const { return ranges_cm_; }
  const base::Pose2& odometry() const { return localisation_.X_OR(); }
  /// Where the robot is in the odometry's frame.
  base::Pose2 truth() const {
    const base::Pose2& start = scene_->course().start;
    const base::Pose2& X_WR = pose();
    return {base::InverseTransform(start, X_WR.p), base::WrapAngle(X_WR.yaw - start.yaw)};
  }

 private:
  static constexpr double kClip = 5.0;

  static std::vector<base::Pose2> Poses(const sim::Course& course) {
    std::vector<base::Vec2> points = course.reference_path_W;
    points.push_back(course.goal_W);
    std::vector<base::Pose2> poses = {course.start};
    base::Vec2 from = course.start.p;
    for (const base::Vec2 to : points) {
      const base::Vec2 way = to - from;
      const double length = base::Norm(way), heading = std::atan2(way.y, way.x);
      for (double s = 0.25; s < length; s += 0.25) {
        const double yaw = poses.back().yaw;
        const double turn = std::clamp(base::WrapAngle(heading - yaw), -0.3, 0.3);
        poses.push_back({from + (s / length) * way, base::WrapAngle(yaw + turn)});
      }
      from = to;
    }
    return poses;
  }

  const std::shared_ptr<const sim::Scene> scene_;
  const std::vector<base::Pose2> poses_W_;
  const sim::Lidar lidar_;
  base::Random noise_;
  sim::Localisation localisation_;
  std::vector<std::uint16_t> ranges_cm_;
  sim::MovingShapes moving_;
  std::size_t step_ = 0;
  double way_ = 0.0;
};

}  // namespace slalom::test
