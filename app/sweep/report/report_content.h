#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/sweep/plan.h"
#include "app/sweep/results.h"
#include "eval/comparison/comparison.h"
#include "eval/comparison/pivot.h"
#include "eval/statistics/statistics.h"

/// What the reports of a sweep show: its results as comparisons of agents (eval/comparison/), and
/// what is known of the trainings.

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
  std::vector<Point> points{};  ///< By steps, at least two.
  /// The curve's mean height between its first and last point, over steps and over seconds.
  eval::Estimate area_over_steps{};
  std::optional<eval::Estimate> area_over_seconds{};
};

/// The curves of a score, for each row with snapshots and at least one seed that has all of them.
std::vector<LearningCurve> LearningCurves(const SweepResults& results, const ScoreResults& score);

/// Whether the results support a conclusion. That on several rows is the first of theirs.
enum class ConclusionVerdict {
  kDoesNotHold,  ///< The whole interval lies elsewhere.
  kMissing,      ///< A row has no evaluation yet.
  kCannotTell,   ///< The interval reaches over the limit, or there is none.
  kHolds,        ///< The whole interval lies where the conclusion says.
};
inline base::OneOf EnumNames(ConclusionVerdict) {
  return {"does not hold", "missing", "cannot tell", "holds"};
}

/// One row of a conclusion.
struct ConclusionFigure {
  std::string row;
  std::string than;  ///< The row that was subtracted; empty: none was.
  /// In the quantity's own unit, with its 95 % interval over seeds and courses. Empty if a row is
  /// missing or no episode has the quantity.
  std::optional<eval::Estimate> estimate;
  ConclusionVerdict verdict = ConclusionVerdict::kMissing;
};

/// A conclusion with a figure for each of its rows.
struct JudgedConclusion {
  Conclusion conclusion;
  std::vector<ConclusionFigure> figures;
  ConclusionVerdict verdict = ConclusionVerdict::kHolds;
};

/// Judges an estimate.
ConclusionVerdict Judge(const eval::Estimate& estimate, ConclusionKind kind, double limit);

/// Judges the conclusions of a plan, in its order. Rows that drove the same courses are compared on
/// these courses pair by pair.
std::vector<JudgedConclusion> JudgeConclusions(const Plan& plan, const SweepResults& results);

/// Means of the trainings of a row, over the seeds that have them.
struct TrainingFigures {
  std::optional<double> steps{};
  std::optional<double> updates{};
  std::optional<double> imagined{};  ///< Transitions that a model imagined.
  std::optional<double> training_s{};
};

/// What an agent of a score is.
struct AgentRow {
  std::size_t row = 0;     ///< Index in `SweepResults::rows`.
  std::int64_t steps = 0;  ///< Of the snapshot; 0: the finished policies.
  TrainingFigures training{};
};

/// One score.
struct ScoreContent {
  std::string name;
  std::string label;
  std::string courses;  ///< As the plan has them.
  /// An agent for each row. Notes say who was trained on some of the courses, unless the score is
  /// on those of the training, and which trained row has the most success, if the plan has axes.
  eval::Group group{};
  std::vector<AgentRow> rows{};  ///< Of each agent.
  /// Row by row, by steps, the finished policies last. A label says after how many steps.
  std::vector<eval::AgentFigures> snapshots{};
  std::vector<AgentRow> snapshot_rows{};  ///< Of each snapshot.
  std::vector<LearningCurve> curves{};
};

/// A published number and its source.
using Published = std::pair<std::string, eval::PivotNumber>;

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
};

/// Collects the results and computes the figures. Cost: 10 to 100 ms for each row and score.
ReportContent MakeContent(const Plan& plan, const Cells& cells, const std::filesystem::path& store);

/// The numbers that the plan has of a row, in its order. `row`: the row's name.
std::vector<Published> FindPublished(const Plan& plan, const std::string& score,
                                     const std::string& row, const eval::Quantity& quantity);

/// "TD3 / 50, seed 2, static-test: failed".
std::string Describe(const MissingScore& missing, const Cells& cells);

}  // namespace slalom::sweep
