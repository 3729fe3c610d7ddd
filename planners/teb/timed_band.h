#pragma once

#include <span>
#include <vector>

#include "base/geometry.h"

namespace slalom::planners {

/// A timed elastic band (Roesmann et al. 2012): poses and the times between them. A value.
struct TimedBand {
  std::vector<base::Pose2> poses;  ///< [n] in O, from the robot to the local goal; n >= 2.
  std::vector<double> dts;         ///< [n - 1] > 0, from pose i to pose i + 1, [s].

  double Duration() const;  ///< [s]
};

/// Makes a band along `points` (two or more, from start to goal) that is headed along it and as
/// fast as the limits [m/s] [rad/s] allow. It has at least `min_samples` poses.
TimedBand MakeBand(std::span<const base::Vec2> points, double start_yaw, double goal_yaw,
                   double max_linear, double max_angular, int min_samples);

/// Inserts a pose if a time is longer than dt_ref + dt_hysteresis, and removes one if it is shorter
/// than dt_ref - dt_hysteresis, in one pass from the start. Keeps the total duration, and the
/// number of times within [min_samples, max_samples].
void ResizeBand(double dt_ref, double dt_hysteresis, int min_samples, int max_samples,
                TimedBand& band);

/// Makes the band begin at `start` and end at `goal`. Removes the poses among the first ten that
/// the robot has passed, as long as min_samples remain.
void MoveEnds(const base::Pose2& start, const base::Pose2& goal, int min_samples, TimedBand& band);

}  // namespace slalom::planners
