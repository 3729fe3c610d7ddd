#include "app/sweep/report/learning_curves.h"

#include <algorithm>
#include <cstdint>
#include <span>

#include "eval/comparison/comparison.h"
#include "eval/statistics/bootstrap.h"
#include "eval/statistics/score_table.h"

namespace slalom::sweep {
namespace {

/// The row's snapshots, one after the other by steps, of those seeds that have all of them.
struct CurveTables {
  std::vector<std::size_t> cells;        // [seed]
  std::vector<std::int64_t> steps;       // [point]
  std::vector<eval::ScoreTable> tables;  // [point]
};

CurveTables TablesOf(const SweepResults& results, std::span<const RowScore> snapshots) {
  CurveTables curve;
  for (const CellScore& seed : snapshots.front().seeds) {
    const bool is_whole = std::ranges::all_of(snapshots, [&](const RowScore& row) {
      const auto found = std::ranges::find(row.seeds, seed.cell, &CellScore::cell);
      return found != row.seeds.end() && found->result.courses.size() == seed.result.courses.size();
    });
    if (is_whole && results.statuses[seed.cell].trained) curve.cells.push_back(seed.cell);
  }
  if (curve.cells.empty()) return curve;
  for (const RowScore& row : snapshots) {
    const std::int64_t steps = row.snapshot_steps > 0
                                   ? row.snapshot_steps
                                   : results.statuses[curve.cells.front()].trained->steps;
    // A snapshot at the last step is the finished policy.
    if (!curve.steps.empty() && steps <= curve.steps.back()) continue;
    eval::Agent agent = AgentOf(results, row);
    agent.seeds.clear();
    for (const CellScore& seed : row.seeds) {
      if (std::ranges::find(curve.cells, seed.cell) == curve.cells.end()) continue;
      agent.seeds.push_back(&seed.result);
    }
    curve.steps.push_back(steps);
    curve.tables.push_back(eval::ScoresOf(agent, eval::Quantities().front()));
  }
  return curve;
}

/// Training time at each point, [s]; empty if one of them is not known or they do not rise.
std::vector<double> SecondsOf(const SweepResults& results, std::size_t cell,
                              std::span<const std::int64_t> steps) {
  std::vector<double> seconds;
  for (const std::int64_t at : steps) {
    const TrainedCell& trained = *results.statuses[cell].trained;
    const auto found = results.snapshot_seconds.find({cell, at});
    const bool is_last = at == steps.back() && at >= trained.steps;
    if (!is_last && found == results.snapshot_seconds.end()) return {};
    const double here = is_last ? trained.training_s : found->second;
    if (!seconds.empty() && here <= seconds.back()) return {};
    seconds.push_back(here);
  }
  return seconds;
}

/// The area under each seed's curve on each course. `x`: [seed][point]
eval::Estimate AreaOf(const CurveTables& curve, const std::vector<std::vector<double>>& x) {
  eval::ScoreTable areas = curve.tables.front();
  for (std::size_t s = 0; s < areas.scores.size(); ++s) {
    for (std::size_t c = 0; c < areas.scores[s].size(); ++c) {
      std::vector<double> heights;
      for (const eval::ScoreTable& table : curve.tables) heights.push_back(table.scores[s][c]);
      areas.scores[s][c] = eval::AreaUnderCurve(x[s], heights);
    }
  }
  return eval::BootstrapMean(areas);
}

LearningCurve MakeCurve(const SweepResults& results, const CurveTables& tables) {
  LearningCurve curve;
  const std::size_t num_seeds = tables.cells.size();
  curve.num_seeds = static_cast<int>(num_seeds);
  std::vector<std::vector<double>> seconds;
  for (const std::size_t cell : tables.cells) {
    seconds.push_back(SecondsOf(results, cell, tables.steps));
  }
  const bool has_seconds =
      std::ranges::none_of(seconds, [](const auto& of_seed) { return of_seed.empty(); });
  for (std::size_t p = 0; p < tables.steps.size(); ++p) {
    LearningCurve::Point& point = curve.points.emplace_back();
    point.steps = static_cast<double>(tables.steps[p]);
    point.success = eval::BootstrapMean(tables.tables[p]);
    if (!has_seconds) continue;
    double sum = 0.0;
    for (const auto& of_seed : seconds) sum += of_seed[p];
    point.seconds = sum / curve.num_seeds;
  }
  const std::vector<double> steps(tables.steps.begin(), tables.steps.end());
  curve.area_over_steps = AreaOf(tables, std::vector(num_seeds, steps));
  if (has_seconds) curve.area_over_seconds = AreaOf(tables, seconds);
  return curve;
}

}  // namespace

std::vector<LearningCurve> LearningCurves(const SweepResults& results, const ScoreResults& score) {
  std::vector<LearningCurve> curves;
  const std::span<const RowScore> all(score.snapshots);
  for (std::size_t begin = 0; begin < all.size();) {
    std::size_t end = begin;
    while (end < all.size() && all[end].row == all[begin].row) ++end;
    const CurveTables tables = TablesOf(results, all.subspan(begin, end - begin));
    if (tables.steps.size() >= 2) {
      curves.push_back(MakeCurve(results, tables));
      curves.back().row = all[begin].row;
      curves.back().num_planned = all[begin].num_planned;
    }
    begin = end;
  }
  return curves;
}

}  // namespace slalom::sweep
