#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "app/sweep/results.h"
#include "eval/report/agent_comparison.h"
#include "eval/statistics/statistics.h"

/// The figures of a sweep's results, as its reports show them. Intervals are 95 % intervals over
/// seeds and courses (eval/statistics/bootstrap.h). docs/sweeps.md explains the reports.

namespace slalom::sweep {

/// One quantity of one row.
struct QuantityFigures {
  /// Estimate over the episodes of all seeds. Empty if no episode has the quantity.
  std::optional<eval::Estimate> estimate;
  /// Mean of the seeds' values, as papers print it. Empty if no seed has one.
  std::optional<double> seed_mean;
  /// Standard deviation of the seeds' values (n - 1). Empty if fewer than two seeds have one.
  std::optional<double> seed_deviation;
};

/// A published number.
struct Published {
  std::string source;
  double value = 0.0;
  std::optional<double> deviation;
};

/// One row of one score's table.
struct RowFigures {
  std::size_t row = 0;  ///< Index in `SweepResults::rows`.
  int num_seeds = 0;    ///< Seeds that were evaluated.
  int num_planned = 0;
  int num_courses = 0;                               ///< 0: no seed.
  int num_episodes = 0;                              ///< Episodes of all seeds.
  std::vector<QuantityFigures> quantities;           ///< As `kQuantities`.
  std::optional<eval::Estimate> interquartile_mean;  ///< Of success; empty: no seed.
  std::optional<eval::Estimate> lowest_twentieth;    ///< The same, of the lowest 5 %.
  std::vector<std::vector<Published>> published;     ///< For each quantity.
  /// Means of the training until then, over the seeds that have them. Empty if no seed has them.
  std::optional<double> steps;
  std::optional<double> updates;
  std::optional<double> imagined;  ///< Transitions that a model imagined.
  std::optional<double> training_s;

  const QuantityFigures& success() const { return quantities.front(); }
};

/// Whether all evaluations of both were on the same courses by the same rules. Requires: each has
/// one.
bool AreOnSameCourses(const RowScore& a, const RowScore& b);

/// The published numbers of a row, in the plan's order.
std::vector<Published> FindPublished(const Plan& plan, const std::string& score,
                                     const std::string& row, const Quantity& quantity);

/// Computes a row's figures. `score`: the name of the score.
RowFigures FiguresOf(const Plan& plan, const SweepResults& results, const std::string& score,
                     const RowScore& row);

/// Success of one row while it learned.
struct LearningCurve {
  struct Point {
    double steps = 0.0;
    std::optional<double> seconds;  ///< Mean over the seeds, [s]; empty if one is not known.
    eval::Estimate success;
  };
  std::size_t row = 0;
  int num_seeds = 0;  ///< Seeds that have every snapshot. The others are not in the curve.
  int num_planned = 0;
  std::vector<Point> points;  ///< By steps, at least two.
  /// The curve's mean height between its first and last point, over steps and over seconds.
  eval::Estimate area_over_steps;
  std::optional<eval::Estimate> area_over_seconds;
};

/// The curves of a score, for each row with snapshots and at least one seed that has all of them.
std::vector<LearningCurve> LearningCurves(const SweepResults& results, const ScoreResults& score);

/// The share of scores on a course that are above each threshold.
struct Profile {
  std::size_t row = 0;
  std::vector<eval::Estimate> shares;  ///< For each of `ProfileThresholds`.
};
/// 0, 0.05 ... 1.
std::vector<double> ProfileThresholds();
std::vector<Profile> ProfilesOf(const ScoreResults& score);

/// Rows compared on the same courses and starts, two by two. `first` and `second` of a pair are
/// indices in `SweepResults::rows`.
struct RowPairs {
  std::vector<eval::AgentPair> pairs;
  /// Why pairs are left out, a sentence; empty: none is.
  std::string note;
};
inline constexpr std::size_t kMaxPairedRows = 12;
/// Compares every two rows that have evaluations, unless there are more than `kMaxPairedRows`.
RowPairs CompareRows(const ScoreResults& score);

}  // namespace slalom::sweep
