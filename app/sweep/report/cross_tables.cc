#include "app/sweep/report/cross_tables.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <set>
#include <span>
#include <string>

#include "base/progress.h"

namespace slalom::sweep {
namespace {

/// "Success rate (%) (↑)"
std::string HeadOf(const eval::Quantity& quantity) {
  std::string head(quantity.title);
  head.front() = static_cast<char>(head.front() - 'a' + 'A');
  return fmt::format("{} {} ({}) ({})", head, quantity.is_rate ? "rate" : "time", quantity.unit,
                     quantity.higher_is_better ? "↑" : "↓");
}

/// The quantities that have numbers in the tables: places in `eval::Quantities`.
std::vector<std::size_t> QuantitiesOf(const Plan& plan) {
  std::vector<std::size_t> quantities;
  for (const std::string_view key : QuantityKeys().choices) {
    const auto& wanted = plan.sweep.quantities;
    if (!wanted.empty() && std::ranges::find(wanted, key) == wanted.end()) continue;
    quantities.push_back(*eval::FindQuantity(key));
  }
  return quantities;
}

/// Where a number stands: the heads of its line, block and column; no column: it is of all.
struct Place {
  std::string line;
  std::string block;
  std::optional<std::string> column;
};

/// The place of a head in its list, which it joins if it is new.
std::size_t IndexOf(std::vector<std::string>& heads, const std::string& head) {
  const auto found = std::ranges::find(heads, head);
  if (found != heads.end()) return static_cast<std::size_t>(found - heads.begin());
  heads.push_back(head);
  return heads.size() - 1;
}

/// Adds the number of an agent to a table; null: only the heads.
void Add(const Place& place, const eval::AgentFigures* agent, std::size_t quantity,
         std::size_t contest, std::span<const Published> published, eval::Pivot& table) {
  eval::PivotEntry entry;
  entry.line = IndexOf(table.lines, place.line);
  entry.block = IndexOf(table.blocks, place.block);
  if (place.column) entry.column = IndexOf(table.columns, *place.column);
  if (agent == nullptr) return;
  const eval::Quantity& of = eval::Quantities()[quantity];
  const auto scaled = [&](std::optional<double> number) {
    return number ? std::optional(of.factor * *number) : std::nullopt;
  };
  const eval::QuantityFigures& figures = agent->quantities[quantity];
  entry.number = {scaled(figures.seed_mean()), scaled(figures.seed_deviation())};
  if (agent->num_seeds != agent->num_planned) {
    entry.mark = fmt::format("{}/{}", agent->num_seeds, agent->num_planned);
  }
  entry.contest = contest;
  entry.higher_is_better = of.higher_is_better;
  for (const Published& number : published) {
    entry.published.emplace_back(number.source,
                                 eval::PivotNumber{scaled(number.value), scaled(number.deviation)});
  }
  table.entries.push_back(std::move(entry));
}

using Layout =
    std::function<Place(const Row& row, const ScoreContent& score, const eval::Quantity& quantity)>;

/// A table of these scores and quantities.
eval::Pivot MakeTable(const ReportContent& content, std::string corner,
                      std::span<const ScoreContent> scores, std::span<const std::size_t> quantities,
                      const Layout& layout) {
  eval::Pivot table{.corner = std::move(corner), .blocks = {}};
  for (std::size_t r = 0; r < content.results.rows.size(); ++r) {
    const Row& row = content.results.rows[r];
    for (std::size_t s = 0; s < scores.size(); ++s) {
      const auto found = std::ranges::find(scores[s].rows, r);
      const eval::AgentFigures* agent =
          found == scores[s].rows.end()
              ? nullptr
              : &scores[s].group.agents[static_cast<std::size_t>(found - scores[s].rows.begin())];
      for (const std::size_t q : quantities) {
        const eval::Quantity& quantity = eval::Quantities()[q];
        Add(layout(row, scores[s], quantity), agent, q, s * eval::Quantities().size() + q,
            FindPublished(content.plan, scores[s].name, row.name, quantity), table);
      }
    }
  }
  return table;
}

/// Rows by their labels, for one quantity and some of the scores.
eval::Pivot AxesTable(const ReportContent& content, std::span<const ScoreContent> scores,
                      std::size_t quantity) {
  const std::vector<std::string>& axes = content.cells.axis_names;
  const std::string head = HeadOf(eval::Quantities()[quantity]);
  eval::Pivot table = MakeTable(
      content, head, scores, std::span(&quantity, 1),
      [&](const Row& row, const ScoreContent& score, const eval::Quantity&) -> Place {
        if (row.labels.size() < axes.size()) return {row.title, score.label, std::nullopt};
        return {
            RowTitle({axes.begin(), axes.end() - 1}, {row.labels.begin(), row.labels.end() - 1}),
            score.label, RowTitle({axes.back()}, {row.labels.back()})};
      });
  table.caption = fmt::format("{}: {} by {}.", content.title, head, axes.back());
  return table;
}

std::vector<eval::Pivot> AxesTables(const ReportContent& content) {
  std::set<std::string> columns;
  for (const Row& row : content.results.rows) {
    if (row.labels.size() == content.cells.axis_names.size()) columns.insert(row.labels.back());
  }
  const std::size_t num_scores = content.scores.size();
  const std::size_t num_columns = std::max<std::size_t>(1, columns.size());
  const std::size_t most = std::max<std::size_t>(1, eval::kMaxPivotColumns / num_columns);
  const std::size_t num_tables = std::max<std::size_t>(1, (num_scores + most - 1) / most);
  const std::size_t at_once = std::max<std::size_t>(1, (num_scores + num_tables - 1) / num_tables);
  std::vector<eval::Pivot> tables;
  for (const std::size_t quantity : QuantitiesOf(content.plan)) {
    for (std::size_t s = 0; s < num_scores; s += at_once) {
      tables.push_back(AxesTable(
          content, std::span(content.scores).subspan(s, std::min(at_once, num_scores - s)),
          quantity));
    }
  }
  return tables;
}

/// Rows and scores, for one quantity.
eval::Pivot QuantityTable(const ReportContent& content, std::size_t quantity) {
  const std::string head = HeadOf(eval::Quantities()[quantity]);
  eval::Pivot table =
      MakeTable(content, head, content.scores, std::span(&quantity, 1),
                [](const Row& row, const ScoreContent& score, const eval::Quantity&) -> Place {
                  return {row.title, "", score.label};
                });
  table.caption = fmt::format("{}: {}.", content.title, head);
  eval::FitToPage(table);
  return table;
}

/// Quantities and rows, for one score.
eval::Pivot ScoreTable(const ReportContent& content, const ScoreContent& score) {
  const auto& axes = content.cells.axis_names;
  eval::Pivot table =
      MakeTable(content, axes.empty() ? "Methods" : fmt::format("{}", fmt::join(axes, " / ")),
                std::span(&score, 1), QuantitiesOf(content.plan),
                [](const Row& row, const ScoreContent&, const eval::Quantity& quantity) -> Place {
                  return {HeadOf(quantity), "", row.name};
                });
  table.caption = fmt::format("{}: {}.", content.title, score.label);
  eval::FitToPage(table);
  return table;
}

/// Success over the steps of the snapshots, for one score.
eval::Pivot SnapshotTable(const ReportContent& content, const ScoreContent& score) {
  eval::Pivot table{.corner = "Steps"};
  std::set<std::int64_t> steps;
  for (const Snapshot& snapshot : score.snapshots) {
    if (snapshot.steps > 0) steps.insert(snapshot.steps);
  }
  for (const std::int64_t step : steps) {
    table.columns.push_back(base::FormatCount(static_cast<double>(step)));
  }
  for (const Snapshot& snapshot : score.snapshots) {
    const std::string column =
        snapshot.steps > 0 ? base::FormatCount(static_cast<double>(snapshot.steps)) : "end";
    Add({content.results.rows[snapshot.row].title, "", column}, &snapshot.agent, 0,
        static_cast<std::size_t>(snapshot.steps), {}, table);
  }
  table.caption = fmt::format("{}: {} on {} by number of environment steps.", content.title,
                              HeadOf(eval::Quantities().front()), score.label);
  return table;
}

}  // namespace

std::vector<eval::Pivot> CrossTables(const ReportContent& content) {
  std::vector<eval::Pivot> tables;
  if (content.cells.axis_names.size() >= 2) {
    tables = AxesTables(content);
  } else if (!content.plan.sweep.quantities.empty()) {
    for (const std::size_t q : QuantitiesOf(content.plan)) {
      tables.push_back(QuantityTable(content, q));
    }
  } else {
    for (const ScoreContent& score : content.scores) tables.push_back(ScoreTable(content, score));
  }
  for (const ScoreContent& score : content.scores) {
    if (!score.snapshots.empty()) tables.push_back(SnapshotTable(content, score));
  }
  std::erase_if(tables, [](const eval::Pivot& table) { return table.entries.empty(); });
  return tables;
}

}  // namespace slalom::sweep
