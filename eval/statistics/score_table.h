#pragma once

#include <span>
#include <string>
#include <vector>

#include "eval/statistics/statistics.h"

/// The scores of agents that were trained with several seeds, and their point estimates.
/// eval/statistics/bootstrap.h adds the intervals; docs/statistics.md has the formulas and sources.

namespace slalom::eval {

/// One quantity (for example the success rate) of one agent. A value.
///
/// The table has a row for each seed (one trained policy) and a column for each course, averaged
/// over the episodes on that course.
///
/// Requires, wherever a table is taken: at least one row, rows of one length, at least one course,
/// numbers that are finite.
struct ScoreTable {
  std::string agent;
  std::vector<std::vector<double>> scores;  ///< [seed][course]
  Interval limits{0.0, 1.0};                ///< Limits of a score. Intervals are cut to them.
  bool trained = true;  ///< Each row is a training. A planner has one row and no training.

  std::size_t num_seeds() const { return scores.size(); }
  std::size_t num_courses() const { return scores.front().size(); }
};

/// Returns the mean over all seeds and courses.
double Mean(const ScoreTable& table);

/// Returns the mean of the middle half of all scores, seeds and courses together (Agarwal et al.
/// 2021): of n sorted scores, floor(n / 4) are left out at each end.
double InterquartileMean(const ScoreTable& table);

/// Returns the mean of the lowest twentieth of all scores, seeds and courses together: the ceil(n /
/// 20) lowest of n.
double LowestTwentiethMean(const ScoreTable& table);

/// Returns the area under the lines through the points (x[i], y[i]), divided by the range of x: the
/// mean height of the curve. Meant for success against steps or seconds of training.
///
/// The area is linear in y. The areas of each seed's curve on each course therefore make a
/// `ScoreTable`, whose mean is the area under the mean curve and has an interval by
/// `BootstrapMean`. Requires: as many y as x, at least two, x strictly increasing.
double AreaUnderCurve(std::span<const double> x, std::span<const double> y);

}  // namespace slalom::eval
