#pragma once

#include <cstdint>

#include "base/geometry.h"
#include "base/random.h"
#include "sim/environment_config.h"

/// Frames: `W` the course's own frame, `R` the robot, `O` the frame of the robot at the beginning
/// of the episode.

namespace slalom::sim {

/// The pose that the robot believes it has: its true motion, with an error added at each step, so
/// that the belief drifts away from the truth. A value; a copy continues with the same errors.
class Localisation {
 public:
  explicit Localisation(const LocalisationConfig& config) : config_(config), random_(0) {}

  /// Starts at `X_WR`, which becomes the frame O. Belief and truth agree there.
  void Reset(const base::Pose2& X_WR, std::uint64_t seed);

  /// Updates the belief after the robot has moved to `X_WR` and its wheels have rolled forward by
  /// `rolled` [m], the mean of both sides. Without drift and without `from_wheels`, the belief
  /// stays equal to the truth.
  ///
  /// With `from_wheels`, the robot believes that it has driven by `rolled` in the direction of its
  /// true heading and never sideways. This is the result of robot_localization's filter with the
  /// Jackal's settings (jackal_control/config/robot_localization.yaml, melodic). They feed it the
  /// wheels' forward and sideways speeds, the latter always 0, and the IMU's heading.
  void Advance(const base::Pose2& X_WR, double rolled);

  /// Whether the wheels tell it how far it has driven.
  bool from_wheels() const { return config_.from_wheels; }
  /// Whether the robot has arrived when it believes so.
  bool decides_arrival() const { return config_.decides_arrival; }
  /// The pose that the robot believes it has, with a heading in [-pi, pi).
  const base::Pose2& X_OR() const { return X_OR_; }
  /// The point p_W in the frame of the robot at its believed pose.
  base::Vec2 InRobotFrame(base::Vec2 p_W) const;

 private:
  bool drifts() const {
    return config_.from_wheels || config_.position_drift > 0.0 || config_.heading_drift > 0.0 ||
           config_.turn_drift > 0.0;
  }

  LocalisationConfig config_;
  base::Random random_;
  base::Pose2 X_WO_;
  base::Pose2 X_WR_;  // The truth.
  base::Pose2 X_OR_;  // The belief.
};

}  // namespace slalom::sim
