#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "app/sweep/plan.h"
#include "app/sweep/report/conclusions.h"
#include "app/sweep/report/figures.h"
#include "app/sweep/results.h"

/// Everything that the reports of a sweep show, so that Markdown, CSV, LaTeX and page agree.

namespace slalom::sweep {

/// One score with its figures.
struct ScoreContent {
  std::string name;
  std::string label;
  std::string courses;   ///< As the plan has them.
  std::string protocol;  ///< A sentence with its rules; empty: nothing was evaluated.
  /// A sentence that names the rows that were trained on some of the courses; empty: none was, or
  /// the score is meant to be on the courses of the training.
  std::string overlap;
  /// A sentence that names the trained row with the most success; empty: the plan has no axes, or
  /// fewer than two rows were scored.
  std::string best_row;
  std::vector<RowFigures> rows;
  std::vector<RowFigures> snapshots;         ///< Row by row, by steps, the finished policies last.
  std::vector<std::int64_t> snapshot_steps;  ///< Steps of each of `snapshots`; 0: finished.
  std::vector<LearningCurve> curves;
  std::vector<Profile> profiles;
  RowPairs pairs;
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

  const Row& row(const RowFigures& figures) const { return results.rows[figures.row]; }
};

/// Collects the results and computes the figures. Cost: 10 to 100 ms for each row and score.
ReportContent MakeContent(const Plan& plan, const Cells& cells, const std::filesystem::path& store);

/// "14 of 15 cells done, 1 failed".
std::string ProgressText(const SweepResults& results);

/// "TD3 / 50, seed 2, static-test: failed".
std::string Describe(const MissingScore& missing, const Cells& cells);

/// "2 h 05 min", "3 min 20 s", "12 s".
std::string FormatSeconds(double seconds);

/// The published numbers beside a score: each source, with a number for at least one of its rows.
struct PublishedColumn {
  std::size_t quantity = 0;  ///< Index in `kQuantities`.
  std::string source;
};
std::vector<PublishedColumn> PublishedColumns(std::span<const RowFigures> rows);
/// The number of a row in such a column; none: nothing was published of it.
std::optional<Published> FindPublished(const RowFigures& row, const PublishedColumn& column);

}  // namespace slalom::sweep
