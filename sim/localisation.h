#pragma once

#include <cstdint>

#include "base/geometry.h"
#include "base/random.h"
#include "sim/environment_config.h"

/// Frames: `W` the course's own frame, `R` the robot, `O` the robot's own frame when the episode
/// began.

namespace slalom::sim {

/// Where the robot believes to be: the true motion with an error added at each step, so that the
/// belief walks away from the truth and comes back by chance alone. A value; a copy goes on alike.
class Localisation {
 public:
  explicit Localisation(const LocalisationConfig& config) : config_(config), random_(0) {}

  /// Knows to be at `X_WR`, the origin of O.
  void Reset(const base::Pose2& X_WR, std::uint64_t seed);

  /// The robot has moved on to `X_WR`. Without drift the belief is the truth.
  void Advance(const base::Pose2& X_WR);

  /// Pose that the robot believes to have, heading in [-pi, pi).
  const base::Pose2& X_OR() const { return X_OR_; }
  /// The point p_W in the frame of the robot, where it believes to be.
  base::Vec2 InRobotFrame(base::Vec2 p_W) const;

 private:
  bool drifts() const {
    return config_.position_drift > 0.0 || config_.heading_drift > 0.0 || config_.turn_drift > 0.0;
  }

  LocalisationConfig config_;
  base::Random random_;
  base::Pose2 X_WO_;
  base::Pose2 X_WR_;  // The truth.
  base::Pose2 X_OR_;  // The belief.
};

}  // namespace slalom::sim
