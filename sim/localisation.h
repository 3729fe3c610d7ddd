#pragma once

#include <cstdint>

#include "base/geometry.h"
#include "base/random.h"
#include "sim/environment_config.h"

/// Frames: `W` the course's own frame, `R` the robot, `O` the frame of the robot at the beginning
/// of the episode.

namespace slalom::sim {

/// Where the robot believes it is: its true motion, with an error added at each step, so that the
/// belief drifts away from the truth. A value; a copy continues with the same errors.
class Localisation {
 public:
  explicit Localisation(const LocalisationConfig& config) : config_(config), random_(0) {}

  /// Starts at `X_WR`, which becomes the frame O. Belief and truth agree there.
  void Reset(const base::Pose2& X_WR, std::uint64_t seed);

  /// Tells that the robot has moved to `X_WR` and that its wheels have rolled ahead by `rolled`
  /// [m], the mean of both sides. Without drift, and unless it reckons `from_wheels`, the belief
  /// stays equal to the truth.
  ///
  /// From wheels, the robot believes that it has driven by `rolled` in the direction of its true
  /// heading and never sideways: what robot_localization's filter makes of the Jackal's settings
  /// (jackal_control/config/robot_localization.yaml, melodic), which give it the wheels' speeds
  /// ahead and to the side, the latter always 0, and the IMU's heading.
  void Advance(const base::Pose2& X_WR, double rolled);

  /// The pose that the robot believes it has, with a heading in [-pi, pi).
  const base::Pose2& X_OR() const { return X_OR_; }
  /// The point p_W in the frame of the robot as it believes it stands.
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
