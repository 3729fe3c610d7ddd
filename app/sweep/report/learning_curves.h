#pragma once

#include <optional>
#include <vector>

#include "app/sweep/results.h"
#include "eval/statistics/statistics.h"

namespace slalom::sweep {

/// Success of one row while it learned.
struct LearningCurve {
  struct Point {
    double steps = 0.0;
    std::optional<double> seconds;  ///< Mean over the seeds, [s]; empty if one is not known.
    eval::Estimate success;
  };
  std::size_t row = 0;  ///< Index in `SweepResults::rows`.
  int num_seeds = 0;    ///< Seeds that have every snapshot. The others are not in the curve.
  int num_planned = 0;
  std::vector<Point> points;  ///< By steps, at least two.
  /// The curve's mean height between its first and last point, over steps and over seconds.
  eval::Estimate area_over_steps;
  std::optional<eval::Estimate> area_over_seconds;
};

/// The curves of a score, for each row with snapshots and at least one seed that has all of them.
std::vector<LearningCurve> LearningCurves(const SweepResults& results, const ScoreResults& score);

}  // namespace slalom::sweep
