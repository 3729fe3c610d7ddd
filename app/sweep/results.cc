#include "app/sweep/results.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "learner/run/metrics_table.h"
#include "learner/run/run_directory.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxMetricsRows = 100000;

std::vector<Row> RowsOf(const Cells& cells) {
  std::vector<Row> rows;
  std::map<std::pair<std::string, std::vector<std::string>>, std::size_t> places;
  for (std::size_t c = 0; c < cells.cells.size(); ++c) {
    const Cell& cell = cells.cells[c];
    const auto [place, is_new] = places.try_emplace({cell.group, cell.row}, rows.size());
    if (is_new) {
      const bool is_planner = !cell.planner.empty();
      std::string title = is_planner || cell.row.size() > cells.axis_names.size()
                              ? cell.row_name()
                              : RowTitle(cells.axis_names, cell.row);
      rows.push_back({cell.row_name(), std::move(title), cell.row, {}, is_planner});
    }
    rows[place->second].cells.push_back(c);
  }
  return rows;
}

/// The evaluation of a task, or why there is none.
struct ReadScore {
  std::optional<eval::Result> result;
  std::string why;
};

ReadScore Read(const fs::path& directory, const CellStatus& status) {
  const fs::path file = directory / eval::kEvaluationFile;
  std::error_code error;
  if (!fs::exists(file, error)) return {std::nullopt, std::string(ToString(status.state))};
  try {
    return {eval::ParseResult(base::ReadFile(file), file.string()).result, ""};
  } catch (const base::Error& fault) {
    return {std::nullopt, fault.what()};
  }
}

/// Adds one evaluation to its row, or to the missing ones.
void Add(const Cells& cells, std::size_t cell, const ScoreTask& task, const fs::path& store,
         RowScore& score, SweepResults& results) {
  const CellDirectory directory(store, cells.cells[cell].id);
  ReadScore read = Read(directory.score(task), results.statuses[cell]);
  if (read.result && !score.seeds.empty()) {
    const std::size_t expected = score.seeds.front().result.courses.size();
    if (const std::size_t found = read.result->courses.size(); found != expected) {
      read = {std::nullopt,
              fmt::format("it has {} courses, and the row's first evaluation {}", found, expected)};
    }
  }
  if (read.result) {
    score.seeds.push_back({cell, std::move(*read.result)});
  } else {
    results.missing.push_back({cell, task.name, task.snapshot_steps, std::move(read.why)});
  }
}

/// The evaluations of one row on a score, by the steps of the snapshot; 0: the finished policies.
std::map<std::int64_t, RowScore> ReadRow(const Cells& cells, std::size_t row,
                                         const std::string& score, const fs::path& store,
                                         SweepResults& results) {
  std::map<std::int64_t, RowScore> by_steps;
  for (const std::size_t cell : results.rows[row].cells) {
    for (const ScoreTask& task : cells.cells[cell].scores) {
      if (task.name != score) continue;
      RowScore& found = by_steps[task.snapshot_steps];
      found.row = row;
      found.snapshot_steps = task.snapshot_steps;
      ++found.num_planned;
      Add(cells, cell, task, store, found, results);
    }
  }
  return by_steps;
}

/// The training time at which a run had made a number of steps, between the rows of its log.
std::optional<double> SecondsAt(const run::MetricsTable& log, std::int64_t steps) {
  const std::vector<double> at = log.Column("steps");
  const std::vector<double> seconds = log.Column("training_s");
  double last_steps = 0.0;
  double last_seconds = 0.0;
  for (std::size_t i = 0; i < at.size(); ++i) {
    if (!std::isfinite(at[i]) || !std::isfinite(seconds[i])) continue;
    if (at[i] >= static_cast<double>(steps)) {
      const double share = at[i] > last_steps ? (steps - last_steps) / (at[i] - last_steps) : 1.0;
      return last_seconds + share * (seconds[i] - last_seconds);
    }
    last_steps = at[i];
    last_seconds = seconds[i];
  }
  return std::nullopt;
}

void ReadSnapshotSeconds(const Cells& cells, const fs::path& store, SweepResults& results) {
  for (std::size_t c = 0; c < cells.cells.size(); ++c) {
    std::set<std::int64_t> steps;
    for (const ScoreTask& task : cells.cells[c].scores) {
      if (task.snapshot_steps > 0) steps.insert(task.snapshot_steps);
    }
    if (steps.empty()) continue;
    const run::RunDirectory run{CellDirectory(store, cells.cells[c].id).run()};
    std::error_code error;
    if (!fs::exists(run.metrics(), error)) continue;
    run::MetricsTable log;
    try {
      log = run::ParseMetrics(base::ReadFile(run.metrics()), kMaxMetricsRows);
    } catch (const base::Error&) {
      continue;  // The curve over seconds is then shorter, and says so.
    }
    for (const std::int64_t step : steps) {
      if (const auto seconds = SecondsAt(log, step)) results.snapshot_seconds[{c, step}] = *seconds;
    }
  }
}

}  // namespace

std::string RowTitle(const std::vector<std::string>& axis_names,
                     const std::vector<std::string>& labels) {
  SLALOM_CHECK(labels.size() <= axis_names.size());
  const auto last_part = [](std::string_view name) { return name.substr(name.rfind('.') + 1); };
  std::vector<std::string> parts;
  for (std::size_t a = 0; a < labels.size(); ++a) {
    const std::string& axis = axis_names[a];
    const bool is_word = !labels[a].empty() &&
                         std::isalpha(static_cast<unsigned char>(labels[a][0])) &&
                         labels[a] != "true" && labels[a] != "false";
    const bool is_key = axis.find('.') != std::string::npos;
    if (is_word && !is_key) {
      parts.push_back(labels[a]);
      continue;
    }
    const auto num_alike = std::ranges::count(axis_names, last_part(axis), last_part);
    parts.push_back(fmt::format("{} {}", num_alike > 1 ? axis : last_part(axis), labels[a]));
  }
  return fmt::format("{}", fmt::join(parts, " / "));
}

int SweepResults::num_cells(CellState state) const {
  return static_cast<int>(std::ranges::count(statuses, state, &CellStatus::state));
}

SweepResults CollectResults(const Plan& plan, const Cells& cells, const fs::path& store) {
  SweepResults results;
  results.rows = RowsOf(cells);
  for (const Cell& cell : cells.cells) results.statuses.push_back(ReadCellStatus(store, cell));
  for (const Score& score : plan.scores) {
    ScoreResults found{score.name, score.label.empty() ? score.name : score.label, {}, {}};
    for (std::size_t r = 0; r < results.rows.size(); ++r) {
      auto by_steps = ReadRow(cells, r, score.name, store, results);
      const bool has_snapshots = by_steps.size() > by_steps.count(0);
      for (auto& [steps, row_score] : by_steps) {
        if (steps > 0) found.snapshots.push_back(std::move(row_score));
      }
      const auto finished = by_steps.find(0);
      if (finished == by_steps.end()) continue;
      if (has_snapshots) found.snapshots.push_back(finished->second);
      found.rows.push_back(std::move(finished->second));
    }
    results.scores.push_back(std::move(found));
  }
  std::ranges::stable_sort(results.missing, {}, &MissingScore::cell);
  ReadSnapshotSeconds(cells, store, results);
  return results;
}

eval::Agent AgentOf(const SweepResults& results, const RowScore& row) {
  const Row& named = results.rows[row.row];
  eval::Agent agent{named.title, !named.is_planner, {}, row.num_planned};
  for (const CellScore& seed : row.seeds) agent.seeds.push_back(&seed.result);
  return agent;
}

}  // namespace slalom::sweep
