#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/sweep/plan.h"
#include "app/sweep/report/conclusions.h"
#include "app/sweep/results.h"
#include "eval/comparison/comparison.h"
#include "eval/statistics/statistics.h"

/// What the reports of a sweep show: its results as comparisons of agents (eval/comparison/).

namespace slalom::sweep {

/// Success of one row while it learned.
struct LearningCurve {
  struct Point {
    double steps = 0.0;
    std::optional<double> seconds;  ///< Mean over the seeds, [s]; empty if one is not known.
    eval::Estimate success;
  };
  std::size_t agent = 0;  ///< Place of the row in `ScoreResults::rows`.
  int num_seeds = 0;      ///< Seeds that have every snapshot. The others are not in the curve.
  int num_planned = 0;
  std::vector<Point> points{};  ///< By steps, at least two.
  /// The curve's mean height between its first and last point, over steps and over seconds.
  eval::Estimate area_over_steps{};
  std::optional<eval::Estimate> area_over_seconds{};
};

/// The curves of a score, for each row with snapshots and at least one seed that has all of them.
std::vector<LearningCurve> LearningCurves(const SweepResults& results, const ScoreResults& score);

/// The row of a snapshot, and its steps.
struct SnapshotRow {
  std::size_t row = 0;     ///< Index in `SweepResults::rows`.
  std::int64_t steps = 0;  ///< 0: the finished policies.
};

/// One score.
struct ScoreContent {
  std::string name;
  std::string label;
  std::string courses;  ///< As the plan has them.
  /// An agent for each row. Notes say who was trained on some of the courses, unless the score is
  /// on those of the training, and which trained row has the most success, if the plan has axes.
  eval::Group group{};
  std::vector<std::size_t> rows{};  ///< Row of each agent: an index in `SweepResults::rows`.
  /// Row by row, by steps, the finished policies last. A label says after how many steps.
  std::vector<eval::AgentFigures> snapshots{};
  std::vector<SnapshotRow> snapshot_rows{};  ///< Of each snapshot.
  std::vector<LearningCurve> curves{};
};

/// A value. Keeps references to plan and cells, which must outlive it.
struct ReportContent {
  const Plan& plan;
  const Cells& cells;
  SweepResults results;
  std::string title;
  /// Sources of the numbers: names and values, as text.
  std::vector<std::pair<std::string, std::string>> provenance;
  /// Sentences that a reader must know before any number.
  std::vector<std::string> warnings;
  std::vector<ScoreContent> scores;           ///< In the plan's order.
  std::vector<JudgedConclusion> conclusions;  ///< In the plan's order.
  /// Evaluations that are not there: "TD3 / 50, seed 2, static-test: failed".
  std::vector<std::string> missing;
};

/// Collects the results and computes the figures. Cost: 10 to 100 ms for each row and score.
ReportContent MakeContent(const Plan& plan, const Cells& cells, const std::filesystem::path& store);

}  // namespace slalom::sweep
