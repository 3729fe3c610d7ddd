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

/// A band along `points` (two or more, the first and last are those of `start` and `goal`), headed
/// along it, in the times that the limits allow [m/s] [rad/s]. Has `min_samples` poses at least.
TimedBand MakeBand(std::span<const base::Vec2> points, double start_yaw, double goal_yaw,
                   double max_linear, double max_angular, int min_samples);

/// Puts poses in where a time is longer than dt_ref + dt_hysteresis and takes some out where one is
/// shorter than dt_ref - dt_hysteresis, in one pass from the start on, keeping the number of times
/// in [min_samples, max_samples] and the whole duration.
void ResizeBand(double dt_ref, double dt_hysteresis, int min_samples, int max_samples,
                TimedBand& band);

/// Lets the band begin at `start` and end at `goal`: of the first ten poses those passed are taken
/// out, as long as min_samples remain.
void MoveEnds(const base::Pose2& start, const base::Pose2& goal, int min_samples, TimedBand& band);

}  // namespace slalom::planners
