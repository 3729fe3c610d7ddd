#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/sweep/plan.h"
#include "app/sweep/report/conclusions.h"
#include "app/sweep/report/learning_curves.h"
#include "app/sweep/results.h"
#include "eval/comparison/comparison.h"

/// What the reports of a sweep show: its results as comparisons of agents (eval/comparison/), and
/// what is known of the trainings.

namespace slalom::sweep {

/// Means of the trainings of a row, over the seeds that have them.
struct TrainingFigures {
  std::optional<double> steps;
  std::optional<double> updates;
  std::optional<double> imagined;  ///< Transitions that a model imagined.
  std::optional<double> training_s;
};

/// An agent after some steps of its training.
struct Snapshot {
  std::size_t row = 0;       ///< Index in `SweepResults::rows`.
  std::int64_t steps = 0;    ///< 0: the finished policies.
  eval::AgentFigures agent;  ///< Its label says after how many steps.
  TrainingFigures training;
};

/// One score.
struct ScoreContent {
  std::string name;
  std::string label;
  std::string courses;  ///< As the plan has them.
  /// An agent for each row. Notes say who was trained on some of the courses, unless the score is
  /// on those of the training, and which trained row has the most success, if the plan has axes.
  eval::Group group;
  std::vector<std::size_t> rows;           ///< Of each agent: index in `SweepResults::rows`.
  std::vector<TrainingFigures> trainings;  ///< Of each agent.
  std::vector<Snapshot> snapshots;         ///< Row by row, by steps, the finished policies last.
  std::vector<LearningCurve> curves;
};

/// A published number.
struct Published {
  std::string source;
  double value = 0.0;
  std::optional<double> deviation;
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
};

/// Collects the results and computes the figures. Cost: 10 to 100 ms for each row and score.
ReportContent MakeContent(const Plan& plan, const Cells& cells, const std::filesystem::path& store);

/// The numbers that the plan has of a row, in its order. `row`: the row's name.
std::vector<Published> FindPublished(const Plan& plan, const std::string& score,
                                     const std::string& row, const eval::Quantity& quantity);

/// "TD3 / 50, seed 2, static-test: failed".
std::string Describe(const MissingScore& missing, const Cells& cells);

}  // namespace slalom::sweep
