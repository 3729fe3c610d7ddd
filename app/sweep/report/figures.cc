#include "app/sweep/report/figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "eval/statistics/bootstrap.h"
#include "eval/statistics/score_table.h"

namespace slalom::sweep {
namespace {

constexpr const Quantity& kSuccess = kQuantities[0];

std::optional<double> MeanOfSeeds(const std::vector<double>& values) {
  if (values.empty()) return std::nullopt;
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

std::optional<double> DeviationOfSeeds(const std::vector<double>& values) {
  if (values.size() < 2) return std::nullopt;
  const double mean = *MeanOfSeeds(values);
  double sum = 0.0;
  for (const double value : values) sum += (value - mean) * (value - mean);
  return std::sqrt(sum / static_cast<double>(values.size() - 1));
}

std::optional<eval::Estimate> EstimateOf(const RowScore& row, const Quantity& quantity) {
  if (row.seeds.empty()) return std::nullopt;
  if (quantity.is_rate) return eval::BootstrapMean(RateTable(row, quantity));
  return eval::BootstrapRatio(TablesOf(row, quantity));
}

QuantityFigures FiguresOf(const RowScore& row, const Quantity& quantity) {
  std::vector<double> values;
  for (const CellScore& seed : row.seeds) {
    if (const auto value = ValueOf(seed.result, quantity)) values.push_back(*value);
  }
  return {EstimateOf(row, quantity), MeanOfSeeds(values), DeviationOfSeeds(values)};
}

/// The row's snapshots, one after the other by steps, of those seeds that have all of them.
struct CurveTables {
  std::vector<std::size_t> cells;        // [seed]
  std::vector<std::int64_t> steps;       // [point]
  std::vector<eval::ScoreTable> tables;  // [point]
};

CurveTables TablesOfCurve(const SweepResults& results, std::span<const RowScore> snapshots) {
  CurveTables curve;
  const auto seed_of = [](const RowScore& row, std::size_t cell) {
    return std::ranges::find(row.seeds, cell, &CellScore::cell);
  };
  for (const CellScore& seed : snapshots.front().seeds) {
    const bool is_whole = std::ranges::all_of(snapshots, [&](const RowScore& row) {
      const auto found = seed_of(row, seed.cell);
      return found != row.seeds.end() && found->result.courses.size() == seed.result.courses.size();
    });
    const bool is_trained = results.statuses[seed.cell].trained.has_value();
    if (is_whole && is_trained) curve.cells.push_back(seed.cell);
  }
  if (curve.cells.empty()) return curve;
  for (const RowScore& row : snapshots) {
    RowScore chosen = row;
    std::erase_if(chosen.seeds, [&](const CellScore& seed) {
      return std::ranges::find(curve.cells, seed.cell) == curve.cells.end();
    });
    const std::int64_t steps = row.snapshot_steps > 0
                                   ? row.snapshot_steps
                                   : results.statuses[curve.cells.front()].trained->steps;
    // A snapshot at the last step is the finished policy.
    if (!curve.steps.empty() && steps <= curve.steps.back()) continue;
    curve.steps.push_back(steps);
    curve.tables.push_back(RateTable(chosen, kSuccess));
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
eval::ScoreTable AreaTable(const CurveTables& curve, const std::vector<std::vector<double>>& x) {
  eval::ScoreTable areas = curve.tables.front();
  for (std::size_t s = 0; s < areas.scores.size(); ++s) {
    for (std::size_t c = 0; c < areas.scores[s].size(); ++c) {
      std::vector<double> heights;
      for (const eval::ScoreTable& table : curve.tables) heights.push_back(table.scores[s][c]);
      areas.scores[s][c] = eval::AreaUnderCurve(x[s], heights);
    }
  }
  return areas;
}

LearningCurve MakeCurve(const SweepResults& results, const CurveTables& tables) {
  LearningCurve curve;
  curve.num_seeds = static_cast<int>(tables.cells.size());
  std::vector<std::vector<double>> seconds;
  for (const std::size_t cell : tables.cells) {
    seconds.push_back(SecondsOf(results, cell, tables.steps));
  }
  const bool has_seconds =
      std::ranges::none_of(seconds, [](const auto& of_seed) { return of_seed.empty(); });
  for (std::size_t p = 0; p < tables.steps.size(); ++p) {
    LearningCurve::Point point;
    point.steps = static_cast<double>(tables.steps[p]);
    point.success = eval::BootstrapMean(tables.tables[p]);
    if (has_seconds) {
      std::vector<double> here;
      here.reserve(seconds.size());
      for (const auto& of_seed : seconds) here.push_back(of_seed[p]);
      point.seconds = MeanOfSeeds(here);
    }
    curve.points.push_back(point);
  }
  const std::vector<double> steps(tables.steps.begin(), tables.steps.end());
  curve.area_over_steps = eval::BootstrapMean(
      AreaTable(tables, std::vector<std::vector<double>>(tables.cells.size(), steps)));
  if (has_seconds) curve.area_over_seconds = eval::BootstrapMean(AreaTable(tables, seconds));
  return curve;
}

/// Whether two evaluations can be compared course by course.
bool AreOnSameCourses(const eval::Result& a, const eval::Result& b) {
  return a.course_set == b.course_set && a.collection == b.collection && a.seed == b.seed &&
         a.protocol == b.protocol &&
         std::ranges::equal(a.courses, b.courses, {}, &eval::ResultCourse::name,
                            &eval::ResultCourse::name);
}

}  // namespace

bool AreOnSameCourses(const RowScore& a, const RowScore& b) {
  return std::ranges::all_of(a.seeds, [&](const CellScore& one) {
    return std::ranges::all_of(b.seeds, [&](const CellScore& other) {
      return AreOnSameCourses(one.result, other.result);
    });
  });
}

std::vector<Published> FindPublished(const Plan& plan, const std::string& score,
                                     const std::string& row, const Quantity& quantity) {
  std::vector<Published> published;
  for (const Reference& reference : plan.references) {
    if (reference.score != score || reference.quantity != quantity.key) continue;
    for (std::size_t i = 0; i < reference.rows.size(); ++i) {
      if (reference.rows[i] != row || i >= reference.values.size()) continue;
      const bool has_deviation = i < reference.deviations.size() && reference.deviations[i] > 0.0;
      published.push_back({reference.source, reference.values[i],
                           has_deviation ? std::optional(reference.deviations[i]) : std::nullopt});
    }
  }
  return published;
}

RowFigures FiguresOf(const Plan& plan, const SweepResults& results, const std::string& score,
                     const RowScore& row) {
  RowFigures figures;
  figures.row = row.row;
  figures.num_seeds = static_cast<int>(row.seeds.size());
  figures.num_planned = row.num_planned;
  for (const CellScore& seed : row.seeds) {
    figures.num_courses = static_cast<int>(seed.result.courses.size());
    figures.num_episodes += seed.result.set.num_episodes;
  }
  for (const Quantity& quantity : kQuantities) {
    figures.quantities.push_back(FiguresOf(row, quantity));
    figures.published.push_back(FindPublished(plan, score, results.rows[row.row].name, quantity));
  }
  if (!row.seeds.empty()) {
    figures.interquartile_mean = eval::BootstrapInterquartileMean(RateTable(row, kSuccess));
    figures.lowest_twentieth = eval::BootstrapLowestTwentiethMean(RateTable(row, kSuccess));
  }
  std::vector<double> steps;
  std::vector<double> updates;
  std::vector<double> imagined;
  std::vector<double> seconds;
  for (const CellScore& seed : row.seeds) {
    const std::optional<TrainedCell>& trained = results.statuses[seed.cell].trained;
    if (row.snapshot_steps > 0) {
      steps.push_back(static_cast<double>(row.snapshot_steps));
      const auto found = results.snapshot_seconds.find({seed.cell, row.snapshot_steps});
      if (found != results.snapshot_seconds.end()) seconds.push_back(found->second);
      continue;
    }
    if (!trained) continue;
    const train::PolicyFigures total = trained->total();
    steps.push_back(static_cast<double>(total.steps));
    updates.push_back(static_cast<double>(total.updates));
    if (trained->imagined) imagined.push_back(static_cast<double>(*trained->imagined));
    seconds.push_back(total.training_s);
  }
  figures.steps = MeanOfSeeds(steps);
  figures.updates = MeanOfSeeds(updates);
  figures.imagined = MeanOfSeeds(imagined);
  figures.training_s = MeanOfSeeds(seconds);
  return figures;
}

std::vector<LearningCurve> LearningCurves(const SweepResults& results, const ScoreResults& score) {
  std::vector<LearningCurve> curves;
  const std::span<const RowScore> all(score.snapshots);
  for (std::size_t begin = 0; begin < all.size();) {
    std::size_t end = begin;
    while (end < all.size() && all[end].row == all[begin].row) ++end;
    const auto snapshots = all.subspan(begin, end - begin);
    const CurveTables tables = TablesOfCurve(results, snapshots);
    if (tables.steps.size() >= 2) {
      curves.push_back(MakeCurve(results, tables));
      curves.back().row = snapshots.front().row;
      curves.back().num_planned = snapshots.front().num_planned;
    }
    begin = end;
  }
  return curves;
}

std::vector<double> ProfileThresholds() {
  std::vector<double> thresholds;
  for (int k = 0; k <= 20; ++k) thresholds.push_back(k / 20.0);
  return thresholds;
}

std::vector<Profile> ProfilesOf(const ScoreResults& score) {
  std::vector<Profile> profiles;
  for (const RowScore& row : score.rows) {
    if (row.seeds.empty()) continue;
    profiles.push_back(
        {row.row, eval::BootstrapProfile(RateTable(row, kSuccess), ProfileThresholds())});
  }
  return profiles;
}

RowPairs CompareRows(const ScoreResults& score) {
  std::vector<const RowScore*> rows;
  for (const RowScore& row : score.rows) {
    if (!row.seeds.empty()) rows.push_back(&row);
  }
  if (rows.size() > kMaxPairedRows) {
    return {{},
            fmt::format("{} rows make too many pairs to compare each with each; `slalom "
                        "compare` compares the two that you name.",
                        rows.size())};
  }
  RowPairs compared;
  int num_different = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (std::size_t j = i + 1; j < rows.size(); ++j) {
      if (!AreOnSameCourses(*rows[i], *rows[j])) {
        ++num_different;
        continue;
      }
      const eval::ScoreTable first = RateTable(*rows[i], kSuccess);
      const eval::ScoreTable second = RateTable(*rows[j], kSuccess);
      compared.pairs.push_back(eval::ComparePair(rows[i]->row, first, rows[j]->row, second));
    }
  }
  eval::CorrectPValues(compared.pairs);
  if (num_different > 0) {
    compared.note = fmt::format(
        "{} pair{} of rows {} left out, as {} evaluated on different courses or by different "
        "rules.",
        num_different, num_different == 1 ? "" : "s", num_different == 1 ? "is" : "are",
        num_different == 1 ? "it was" : "they were");
  }
  return compared;
}

}  // namespace slalom::sweep
