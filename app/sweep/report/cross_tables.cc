#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "app/sweep/report/report.h"
#include "base/progress.h"

namespace slalom::sweep {
namespace {

/// "Success rate (%) (↑)"
std::string HeadOf(const eval::Quantity& quantity) {
  std::string head(quantity.title);
  head.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(head.front())));
  if (!quantity.unit.empty()) {
    head += fmt::format(" {} ({})", quantity.is_rate ? "rate" : "time", quantity.unit);
  }
  return head + (quantity.higher_is_better ? " (↑)" : " (↓)");
}

/// The quantities that have numbers in the tables: places in `eval::Quantities`.
std::vector<std::size_t> QuantitiesOf(const Plan& plan) {
  std::vector<std::string> wanted = plan.sweep.quantities;
  if (wanted.empty()) wanted.assign(kUsualQuantities.begin(), kUsualQuantities.end());
  std::vector<std::size_t> quantities;
  quantities.reserve(wanted.size());
  for (const std::string& key : wanted) quantities.push_back(*eval::FindQuantity(key));
  std::ranges::sort(quantities);
  return quantities;
}

/// A table of these scores and quantities. `place`: of a row, score and quantity.
template <class Place>
eval::Pivot MakeTable(const ReportContent& content, std::string corner, const std::string& caption,
                      std::span<const ScoreContent> scores, std::span<const std::size_t> quantities,
                      const Place& place) {
  eval::Pivot table{.corner = std::move(corner),
                    .blocks = {},
                    .caption = fmt::format("{}: {}.", content.title, caption)};
  for (std::size_t r = 0; r < content.results.rows.size(); ++r) {
    for (const ScoreContent& score : scores) {
      const auto found = std::ranges::find(score.rows, r);
      const auto* const agent =
          found == score.rows.end() ? nullptr : &score.group.agents[found - score.rows.begin()];
      for (const std::size_t q : quantities) {
        const std::size_t contest = (&score - scores.data()) * eval::Quantities().size() + q;
        table.Add(place(content.results.rows[r], score, eval::Quantities()[q]), agent, q, contest);
      }
    }
  }
  return table;
}

/// A table of quantities and rows for each score.
std::vector<eval::Pivot> ScoreTables(const ReportContent& content) {
  const auto& axes = content.cells.axis_names;
  const std::string corner = axes.empty() ? "Methods" : fmt::format("{}", fmt::join(axes, " / "));
  std::vector<eval::Pivot> tables;
  for (const ScoreContent& score : content.scores) {
    tables.push_back(MakeTable(content, corner, score.label, std::span(&score, 1),
                               QuantitiesOf(content.plan),
                               [](const Row& row, const auto&, const eval::Quantity& quantity) {
                                 return eval::PivotPlace{HeadOf(quantity), "", row.name};
                               }));
  }
  return tables;
}

/// How many scores have room beside each other, with the last axis below each of them.
std::size_t NumScoresAcross(const ReportContent& content) {
  const std::size_t num_axes = content.cells.axis_names.size();
  std::set<std::string> columns;
  for (const Row& row : content.results.rows) {
    if (row.labels.size() == num_axes) columns.insert(row.labels.back());
  }
  const std::size_t most =
      std::max<std::size_t>(1, eval::kMaxPivotColumns / std::max<std::size_t>(1, columns.size()));
  const std::size_t num_tables = (content.scores.size() + most - 1) / most;
  return (content.scores.size() + num_tables - 1) / std::max<std::size_t>(1, num_tables);
}

/// A table for each quantity, with a line for each row and a column for each score. With several
/// axes the last is below each score; scores that are too many for a page are then shared out.
std::vector<eval::Pivot> QuantityTables(const ReportContent& content) {
  const std::vector<std::string>& axes = content.cells.axis_names;
  const std::span<const ScoreContent> scores(content.scores);
  const bool has_axes = axes.size() >= 2;
  const auto place = [&](const Row& row, const ScoreContent& score,
                         const auto&) -> eval::PivotPlace {
    if (!has_axes) return {row.title, "", score.label};
    if (row.labels.size() < axes.size()) return {row.title, score.label, std::nullopt};
    return {RowTitle({axes.begin(), axes.end() - 1}, {row.labels.begin(), row.labels.end() - 1}),
            score.label, RowTitle({axes.back()}, {row.labels.back()})};
  };
  const std::size_t across = has_axes ? NumScoresAcross(content) : scores.size();
  std::vector<eval::Pivot> tables;
  for (const std::size_t quantity : QuantitiesOf(content.plan)) {
    const std::string head = HeadOf(eval::Quantities()[quantity]);
    const std::string caption = has_axes ? fmt::format("{} by {}", head, axes.back()) : head;
    for (std::size_t s = 0; s < scores.size(); s += across) {
      tables.push_back(MakeTable(content, head, caption,
                                 scores.subspan(s, std::min(across, scores.size() - s)),
                                 std::span(&quantity, 1), place));
    }
  }
  return tables;
}

/// Success over the steps of the snapshots, for one score.
eval::Pivot SnapshotTable(const ReportContent& content, const ScoreContent& score) {
  eval::Pivot table{
      .corner = "Steps",
      .caption = fmt::format("{}: {} on {} by number of environment steps.", content.title,
                             HeadOf(eval::Quantities().front()), score.label)};
  std::set<std::int64_t> steps;
  for (const SnapshotRow& row : score.snapshot_rows) {
    if (row.steps > 0) steps.insert(row.steps);
  }
  for (const std::int64_t step : steps) table.columns.push_back(base::FormatCount(step));
  for (std::size_t i = 0; i < score.snapshots.size(); ++i) {
    const auto& [row, step] = score.snapshot_rows[i];
    table.Add({content.results.rows[row].title, "", step > 0 ? base::FormatCount(step) : "end"},
              &score.snapshots[i], 0, static_cast<std::size_t>(step));
  }
  return table;
}

}  // namespace

std::vector<eval::Pivot> CrossTables(const ReportContent& content) {
  const bool has_axes = content.cells.axis_names.size() >= 2;
  std::vector<eval::Pivot> tables = has_axes || !content.plan.sweep.quantities.empty()
                                        ? QuantityTables(content)
                                        : ScoreTables(content);
  if (!has_axes) std::ranges::for_each(tables, eval::FitToPage);
  for (const ScoreContent& score : content.scores) {
    if (!score.snapshots.empty()) tables.push_back(SnapshotTable(content, score));
  }
  std::erase_if(tables, [](const eval::Pivot& table) { return table.entries.empty(); });
  return tables;
}

}  // namespace slalom::sweep
