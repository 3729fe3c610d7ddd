#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "app/sweep/cell.h"
#include "app/sweep/plan.h"
#include "app/sweep/store.h"
#include "eval/comparison/comparison.h"
#include "eval/report/result.h"

/// The results of a plan's cells so far: their evaluations by row and score. The reports are made
/// from it (app/sweep/report/report_content.h).

namespace slalom::sweep {

/// The evaluation of one cell.
struct CellScore {
  std::size_t cell = 0;  ///< Index in `Cells::cells`.
  eval::Result result;   ///< Without courses' shapes and tracks.
};

/// The evaluations of one row on one score. All of them are on equally many courses.
struct RowScore {
  std::size_t row = 0;              ///< Index in `SweepResults::rows`.
  std::int64_t snapshot_steps = 0;  ///< 0: of the finished policies.
  int num_planned = 0;              ///< Cells of the row that have this score in the plan.
  std::vector<CellScore> seeds;     ///< Those that are there, in the plan's order; may be empty.

  bool is_complete() const { return static_cast<int>(seeds.size()) == num_planned; }
};

/// All evaluations on one score.
struct ScoreResults {
  std::string name;
  std::string label;
  std::vector<RowScore> rows;       ///< Rows without this score are left out.
  std::vector<RowScore> snapshots;  ///< Row by row, each by steps, the finished policies last.
};

/// Cells that differ only in their seed.
struct Row {
  std::string name;                 ///< "TD3 / 50".
  std::string title;                ///< `RowTitle`: its name where no head names the axes.
  std::vector<std::string> labels;  ///< As `Cell::row`.
  std::vector<std::size_t> cells;   ///< Indices in `Cells::cells`.
  bool is_planner = false;
};

/// Returns a row's name with the axes: "n_step 4.0 / head_layers [64, 64]". An axis without a name
/// of its own goes by the last part of its key, or by the whole key if two end alike. Labels that
/// are words stand alone if their axis has a name of its own. Requires: at most as many labels as
/// axes.
std::string RowTitle(const std::vector<std::string>& axis_names,
                     const std::vector<std::string>& labels);

/// An evaluation that the plan asks for and that is not there.
struct MissingScore {
  std::size_t cell = 0;
  std::string score;
  std::int64_t snapshot_steps = 0;
  std::string why;  ///< "waiting", "training", "failed", or what is wrong with its file.
};

/// A value.
struct SweepResults {
  std::vector<Row> rows;              ///< In the plan's order.
  std::vector<ScoreResults> scores;   ///< In the plan's order.
  std::vector<CellStatus> statuses;   ///< Status of each cell.
  std::vector<MissingScore> missing;  ///< Cell by cell.
  /// Time spent training until each snapshot, [s], by cell and steps. Missing if the run's
  /// metrics.csv does not reach that far.
  std::map<std::pair<std::size_t, std::int64_t>, double> snapshot_seconds;

  int num_cells(CellState state) const;
};

/// Collects the results below `store`. Never fails because of a cell: lists unreadable scores in
/// `missing`. Cost: reads every evaluation.json of the plan.
SweepResults CollectResults(const Plan& plan, const Cells& cells,
                            const std::filesystem::path& store);

/// The row as an agent of a comparison, by its title. Points to `row`.
eval::Agent AgentOf(const SweepResults& results, const RowScore& row);

}  // namespace slalom::sweep
