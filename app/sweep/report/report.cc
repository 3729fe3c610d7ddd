#include "app/sweep/report/report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <iterator>
#include <optional>
#include <set>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "app/sweep/store.h"
#include "base/config_field.h"
#include "base/error.h"
#include "base/file.h"
#include "base/progress.h"
#include "eval/comparison/printers.h"
#include "eval/report/table_text.h"

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

/// The heads of a number's line, block and column; no column: it is of all.
struct Place {
  std::string line;
  std::string block;
  std::optional<std::string> column;
};

/// The place of a head in its list, which it joins if it is new.
std::size_t IndexOf(std::vector<std::string>& heads, const std::string& head) {
  const auto found = std::ranges::find(heads, head);
  const auto index = static_cast<std::size_t>(found - heads.begin());
  if (found == heads.end()) heads.push_back(head);
  return index;
}

/// Adds the number of an agent to a table; null: only the heads.
void Add(const Place& place, const eval::AgentFigures* agent, std::size_t quantity,
         std::size_t contest, std::vector<Published> published, eval::Pivot& table) {
  eval::PivotEntry entry{.line = IndexOf(table.lines, place.line),
                         .block = IndexOf(table.blocks, place.block)};
  if (place.column) entry.column = IndexOf(table.columns, *place.column);
  if (agent == nullptr) return;
  const eval::Quantity& of = eval::Quantities()[quantity];
  const eval::QuantityFigures& figures = agent->quantities[quantity];
  entry.number = {figures.seed_mean(), figures.seed_deviation()};
  entry.published = std::move(published);
  const auto scale = [&](eval::PivotNumber& number) {
    for (std::optional<double>* part : {&number.mean, &number.deviation}) {
      if (*part) **part *= of.factor;
    }
  };
  scale(entry.number);
  for (auto& [source, number] : entry.published) scale(number);
  if (agent->num_seeds != agent->num_planned) {
    entry.mark = fmt::format("{}/{}", agent->num_seeds, agent->num_planned);
  }
  entry.contest = contest;
  entry.higher_is_better = of.higher_is_better;
  table.entries.push_back(std::move(entry));
}

/// A table of these scores and quantities. `layout`: the place of a row, score and quantity.
template <class Layout>
eval::Pivot MakeTable(const ReportContent& content, std::string corner, const std::string& caption,
                      std::span<const ScoreContent> scores, std::span<const std::size_t> quantities,
                      const Layout& layout) {
  eval::Pivot table{.corner = std::move(corner), .blocks = {}};
  for (std::size_t r = 0; r < content.results.rows.size(); ++r) {
    const Row& row = content.results.rows[r];
    for (std::size_t s = 0; s < scores.size(); ++s) {
      const ScoreContent& score = scores[s];
      const auto found = std::ranges::find(score.rows, r, &AgentRow::row);
      const auto agent = static_cast<std::size_t>(found - score.rows.begin());
      for (const std::size_t q : quantities) {
        const eval::Quantity& quantity = eval::Quantities()[q];
        Add(layout(row, score, quantity),
            found == score.rows.end() ? nullptr : &score.group.agents[agent], q,
            s * eval::Quantities().size() + q,
            FindPublished(content.plan, score.name, row.name, quantity), table);
      }
    }
  }
  table.caption = fmt::format("{}: {}.", content.title, caption);
  return table;
}

/// A table for each quantity, with rows by their labels below each score. Scores that are too many
/// for a page are shared out.
std::vector<eval::Pivot> AxesTables(const ReportContent& content) {
  const std::vector<std::string>& axes = content.cells.axis_names;
  const auto layout = [&](const Row& row, const ScoreContent& score, const auto&) -> Place {
    if (row.labels.size() < axes.size()) return {row.title, score.label, std::nullopt};
    return {RowTitle({axes.begin(), axes.end() - 1}, {row.labels.begin(), row.labels.end() - 1}),
            score.label, RowTitle({axes.back()}, {row.labels.back()})};
  };
  std::set<std::string> columns;
  for (const Row& row : content.results.rows) {
    if (row.labels.size() == axes.size()) columns.insert(row.labels.back());
  }
  const std::span<const ScoreContent> scores(content.scores);
  const std::size_t num_columns = std::max<std::size_t>(1, columns.size());
  const std::size_t most = std::max<std::size_t>(1, eval::kMaxPivotColumns / num_columns);
  const std::size_t num_tables = (scores.size() + most - 1) / most;
  std::vector<eval::Pivot> tables;
  for (const std::size_t quantity : QuantitiesOf(content.plan)) {
    const std::string head = HeadOf(eval::Quantities()[quantity]);
    const std::size_t at_once = (scores.size() + num_tables - 1) / num_tables;
    for (std::size_t s = 0; s < scores.size(); s += at_once) {
      tables.push_back(MakeTable(content, head, fmt::format("{} by {}", head, axes.back()),
                                 scores.subspan(s, std::min(at_once, scores.size() - s)),
                                 std::span(&quantity, 1), layout));
    }
  }
  return tables;
}

/// A table of rows and scores for each quantity that the plan names.
std::vector<eval::Pivot> QuantityTables(const ReportContent& content) {
  std::vector<eval::Pivot> tables;
  for (const std::size_t quantity : QuantitiesOf(content.plan)) {
    const std::string head = HeadOf(eval::Quantities()[quantity]);
    tables.push_back(MakeTable(content, head, head, content.scores, std::span(&quantity, 1),
                               [](const Row& row, const ScoreContent& score, const auto&) {
                                 return Place{row.title, "", score.label};
                               }));
    eval::FitToPage(tables.back());
  }
  return tables;
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
                                 return Place{HeadOf(quantity), "", row.name};
                               }));
    eval::FitToPage(tables.back());
  }
  return tables;
}

/// Success over the steps of the snapshots, for one score.
eval::Pivot SnapshotTable(const ReportContent& content, const ScoreContent& score) {
  eval::Pivot table{.corner = "Steps"};
  std::set<std::int64_t> steps;
  for (const AgentRow& row : score.snapshot_rows) {
    if (row.steps > 0) steps.insert(row.steps);
  }
  for (const std::int64_t step : steps) table.columns.push_back(base::FormatCount(step));
  for (std::size_t i = 0; i < score.snapshots.size(); ++i) {
    const AgentRow& row = score.snapshot_rows[i];
    const std::string column = row.steps > 0 ? base::FormatCount(row.steps) : "end";
    Add({content.results.rows[row.row].title, "", column}, &score.snapshots[i], 0,
        static_cast<std::size_t>(row.steps), {}, table);
  }
  table.caption = fmt::format("{}: {} on {} by number of environment steps.", content.title,
                              HeadOf(eval::Quantities().front()), score.label);
  return table;
}

}  // namespace

std::vector<eval::Pivot> CrossTables(const ReportContent& content) {
  std::vector<eval::Pivot> tables = content.cells.axis_names.size() >= 2 ? AxesTables(content)
                                    : !content.plan.sweep.quantities.empty()
                                        ? QuantityTables(content)
                                        : ScoreTables(content);
  for (const ScoreContent& score : content.scores) {
    if (!score.snapshots.empty()) tables.push_back(SnapshotTable(content, score));
  }
  std::erase_if(tables, [](const eval::Pivot& table) { return table.entries.empty(); });
  return tables;
}

namespace {

namespace fs = std::filesystem;

using eval::EscapeMarkdown;
using eval::EstimateText;

/// "500k", "500k + 12.5M imagined"
std::string StepsText(const TrainingFigures& training) {
  if (!training.steps) return "–";
  std::string text = base::FormatCount(*training.steps);
  if (training.imagined) {
    text += fmt::format(" + {} imagined", base::FormatCount(*training.imagined));
  }
  return text;
}

/// The figures of agents beside their trainings.
std::string FiguresText(std::span<const eval::AgentFigures> agents, std::span<const AgentRow> rows,
                        std::span<const std::size_t> columns) {
  eval::MarkdownTable table = eval::FiguresTable(agents, columns);
  table.titles.insert(table.titles.end(), {"steps", "training"});
  for (std::size_t i = 0; i < agents.size(); ++i) {
    const TrainingFigures& training = rows[i].training;
    table.rows[i].push_back(StepsText(training));
    table.rows[i].push_back(training.training_s ? base::FormatDuration(*training.training_s) : "–");
  }
  return table.Print();
}

std::string CurveText(const ReportContent& content, const ScoreContent& score) {
  eval::MarkdownTable table{
      .titles = {"row", "seeds", "area over steps [%]", "area over seconds [%]"}};
  for (const LearningCurve& curve : score.curves) {
    table.rows.push_back({EscapeMarkdown(content.results.rows[curve.row].title),
                          fmt::format("{} of {}", curve.num_seeds, curve.num_planned),
                          EstimateText(curve.area_over_steps, 100.0, 1),
                          EstimateText(curve.area_over_seconds, 100.0, 1)});
  }
  return "\nThe area under a curve of success is its mean height between its first and last "
         "snapshot.\n\n" +
         table.Print();
}

std::string ScoreText(const ReportContent& content, const ScoreContent& score) {
  const eval::Group& group = score.group;
  std::string text = fmt::format("\n## {}\n\nCourses: {}. {}\n\n{}", EscapeMarkdown(score.label),
                                 EscapeMarkdown(score.courses), EscapeMarkdown(group.protocol),
                                 FiguresText(group.agents, score.rows, group.columns));
  for (const std::string& note : group.notes) text += "\n" + EscapeMarkdown(note) + "\n";
  if (!score.snapshots.empty()) {
    text += "\n### While learning\n\n" +
            FiguresText(score.snapshots, score.snapshot_rows, group.columns);
  }
  if (!score.curves.empty()) text += CurveText(content, score);
  if (!group.pairs.empty()) text += "\n### Row against row\n\n" + eval::PairTable(group).Print();
  return text;
}

/// "GRU / 4 less MLP / 1 on static-test: success -3.8 (-6.1–-1.5) points"
std::string FigureText(const ReportContent& content, const Conclusion& conclusion,
                       const ConclusionFigure& figure) {
  const eval::Quantity& quantity = eval::Quantities()[*eval::FindQuantity(conclusion.quantity)];
  const auto on = [&](const std::string& row, const std::string& name) {
    const auto score = std::ranges::find(content.scores, name, &ScoreContent::name);
    return fmt::format("{} on {}", row, score->label);
  };
  const bool is_difference = !figure.than.empty();
  const std::string what =
      !is_difference ? on(figure.row, conclusion.score)
      : conclusion.than_score.empty()
          ? on(fmt::format("{} less {}", figure.row, figure.than), conclusion.score)
          : on(figure.row, conclusion.score) + " less " + on(figure.than, conclusion.than_score);
  if (!figure.estimate) return EscapeMarkdown(what) + ": –";
  return fmt::format("{}: {} {} {}", EscapeMarkdown(what), quantity.title,
                     EstimateText(figure.estimate, quantity.factor, quantity.digits),
                     is_difference ? quantity.difference_unit() : quantity.unit);
}

std::string LimitText(const Conclusion& conclusion) {
  const eval::Quantity& quantity = eval::Quantities()[*eval::FindQuantity(conclusion.quantity)];
  return fmt::format("{} {}{:.4g}", base::EnumName(conclusion.kind),
                     conclusion.kind == ConclusionKind::kWithin ? "± " : "",
                     quantity.factor * conclusion.limit);
}

std::string MissingText(const ReportContent& content) {
  const SweepResults& results = content.results;
  std::string text;
  auto out = std::back_inserter(text);
  if (results.num_cells(CellState::kFailed) > 0) text += "\n## Failures\n";
  for (std::size_t c = 0; c < results.statuses.size(); ++c) {
    const auto& failure = results.statuses[c].failure;
    if (results.statuses[c].state != CellState::kFailed || !failure) continue;
    fmt::format_to(out, "\n**{}** (cells/{}): {}\n", EscapeMarkdown(content.cells.cells[c].name()),
                   content.cells.cells[c].id, EscapeMarkdown(failure->what));
    if (!failure->log.empty()) fmt::format_to(out, "\n~~~~~~\n{}\n~~~~~~\n", failure->log);
  }
  if (results.missing.empty()) return text;
  text += "\n## Missing\n\n";
  for (const MissingScore& missing : results.missing) {
    text += "- " + EscapeMarkdown(Describe(missing, content.cells)) + "\n";
  }
  return text;
}

/// "74.2 (70.1–78.0)", and the number of its seeds if some are missing.
std::string SummaryCell(const eval::AgentFigures& agent) {
  std::string text = EstimateText(agent.success().estimate, 100.0, 1);
  if (agent.num_seeds > 0 && agent.num_seeds < agent.num_planned) {
    text += fmt::format(", {} of {} seeds", agent.num_seeds, agent.num_planned);
  }
  return text;
}

/// The table with its lines as columns.
eval::MarkdownTable Transposed(const eval::MarkdownTable& table) {
  eval::MarkdownTable turned{.titles = {table.titles.front()}};
  for (const auto& row : table.rows) turned.titles.push_back(row.front());
  for (std::size_t c = 1; c < table.titles.size(); ++c) {
    std::vector<std::string>& cells = turned.rows.emplace_back();
    cells.push_back(table.titles[c]);
    for (const auto& row : table.rows) cells.push_back(row[c]);
  }
  return turned;
}

constexpr std::string_view kBegin = "<!-- sweep ";
constexpr std::string_view kEnd = "<!-- end of sweep -->";

/// The new text of a block; none: it is of another plan.
std::optional<std::string> BlockText(const std::string& kind, const std::string& name,
                                     std::span<const ReportContent> contents) {
  if (kind == "conclusions" && name == "-->") return MarkdownConclusions(contents);
  for (const ReportContent& content : contents) {
    if (content.plan.sweep.name != name) continue;
    if (kind == "conclusions") return MarkdownConclusions(std::span(&content, 1));
    if (kind == "summary") return "\n" + MarkdownSummary(content);
    const std::vector<eval::Pivot> tables = CrossTables(content);
    return tables.empty() ? "" : "\n" + eval::MarkdownOf(tables.front());
  }
  return std::nullopt;
}

}  // namespace

void WriteSweepReport(const ReportContent& content, const fs::path& store) {
  const fs::path directory = PlanDirectory(store, content.plan.sweep.name);
  base::MakeDirectories(directory);
  base::WriteFileAtomically(directory / "report.csv", CellCsv(content));
  base::WriteFileAtomically(directory / "report-rows.csv", RowCsv(content));
  base::WriteFileAtomically(directory / "report.md", MarkdownReport(content));
  base::WriteFileAtomically(directory / "report.html", SweepPage(content));
}

std::string SweepSummary(const ReportContent& content) {
  eval::MarkdownTable table{.titles = {"success [%]"}};
  for (const Row& row : content.results.rows) table.rows.push_back({row.title});
  for (const ScoreContent& score : content.scores) {
    table.titles.push_back(score.label);
    for (auto& row : table.rows) row.emplace_back();
    for (std::size_t i = 0; i < score.rows.size(); ++i) {
      table.rows[score.rows[i].row].back() = SummaryCell(score.group.agents[i]);
    }
  }
  if (content.scores.size() > table.rows.size()) table = Transposed(table);
  return table.PrintAligned();
}

std::string MarkdownConclusions(std::span<const ReportContent> contents) {
  eval::MarkdownTable table{
      .titles = {"conclusion", "figure, with its 95 % interval", "expected", "verdict"},
      .num_names = 4};
  for (const ReportContent& content : contents) {
    for (const JudgedConclusion& judged : content.conclusions) {
      std::vector<std::string> figures;
      for (const ConclusionFigure& figure : judged.figures) {
        figures.push_back(FigureText(content, judged.conclusion, figure));
      }
      table.rows.push_back(
          {EscapeMarkdown(judged.conclusion.text), fmt::format("{}", fmt::join(figures, "<br>")),
           LimitText(judged.conclusion), std::string(base::EnumName(judged.verdict))});
    }
  }
  return "\n" + table.Print();
}

std::string MarkdownSummary(const ReportContent& content) {
  std::string text;
  for (const auto& [name, value] : content.provenance) {
    text += fmt::format("- {}: {}\n", name, EscapeMarkdown(value));
  }
  for (const std::string& warning : content.warnings) {
    text += fmt::format("\n**Note:** {}\n", EscapeMarkdown(warning));
  }
  for (const eval::Pivot& table : CrossTables(content)) text += "\n" + eval::MarkdownOf(table);
  return text;
}

std::string MarkdownReport(const ReportContent& content) {
  std::string text =
      fmt::format("# {}\n\n", EscapeMarkdown(content.title)) + MarkdownSummary(content);
  if (!content.conclusions.empty()) text += MarkdownConclusions(std::span(&content, 1));
  text += fmt::format("\n{}\n\n{}\n", eval::kFiguresLegend, eval::kPairLegend);
  for (const ScoreContent& score : content.scores) text += ScoreText(content, score);
  return text + MissingText(content);
}

std::string FillBlocks(const std::string& page, const std::string& source,
                       std::span<const ReportContent> contents) {
  std::istringstream lines(page);
  std::string text;
  std::string line;
  bool has_filled = false;
  for (int number = 1; std::getline(lines, line); ++number) {
    text += line + "\n";
    if (!line.starts_with(kBegin)) continue;
    const auto require = [&](bool condition, const std::string& what) {
      base::ThrowIf(!condition, "{}:{}: {}", source, number, what);
    };
    std::string kind;
    std::string name;
    std::istringstream(line.substr(kBegin.size())) >> kind >> name;
    require(
        kind == "table" || kind == "summary" || kind == "conclusions",
        fmt::format("the block is of the kind '{}', expected table, summary or conclusions", kind));
    std::string former;
    while (std::getline(lines, line) && line != kEnd) former += line + "\n";
    require(static_cast<bool>(lines),
            fmt::format("the block has no end, expected a line \"{}\"", kEnd));
    number += static_cast<int>(std::ranges::count(former, '\n')) + 1;
    const std::optional<std::string> block = BlockText(kind, name, contents);
    has_filled = has_filled || block.has_value();
    text += fmt::format("{}{}\n", block ? *block + "\n" : former, kEnd);
  }
  if (has_filled) return text;
  throw base::Error("{}: has no block of these plans, expected a line such as \"{}table {} -->\"",
                    source, kBegin, contents.front().plan.sweep.name);
}

}  // namespace slalom::sweep
