#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <sstream>
#include <vector>

#include "app/sweep/report/grid.h"
#include "app/sweep/report/report.h"
#include "base/config_field.h"
#include "base/error.h"
#include "base/progress.h"
#include "eval/report/table_text.h"

namespace slalom::sweep {
namespace {

using eval::EscapeMarkdown;
using eval::EstimateText;
using eval::PValueText;

std::string PublishedText(const std::optional<Published>& published, const Quantity& quantity) {
  if (!published) return "";
  std::string text = fmt::format("{:.4g}", quantity.factor * published->value);
  if (published->deviation) {
    text += fmt::format(" ± {:.3g}", quantity.factor * *published->deviation);
  }
  return text;
}

std::string SeedsText(const RowFigures& row, bool is_planner) {
  if (is_planner && row.num_seeds == row.num_planned) return "–";  // It has none.
  return row.num_seeds == row.num_planned
             ? fmt::format("{}", row.num_seeds)
             : fmt::format("**{} of {}**", row.num_seeds, row.num_planned);
}

/// "500k", "500k + 12.5M imagined"
std::string StepsText(const RowFigures& row) {
  if (!row.steps) return "–";
  std::string text = base::FormatCount(*row.steps);
  if (row.imagined) text += fmt::format(" + {} imagined", base::FormatCount(*row.imagined));
  return text;
}

std::string RowTable(const ReportContent& content, const std::vector<RowFigures>& rows,
                     const std::vector<std::int64_t>& snapshot_steps) {
  const std::vector<PublishedColumn> published = PublishedColumns(rows);
  const bool has_snapshots = !snapshot_steps.empty();
  const auto& axes = content.cells.axis_names;
  eval::MarkdownTable table;
  table.titles.push_back(axes.empty() ? "row"
                                      : EscapeMarkdown(fmt::format("{}", fmt::join(axes, " / "))));
  if (has_snapshots) table.titles.push_back("after");
  table.titles.push_back("seeds");
  for (const Quantity& quantity : kQuantities) {
    table.titles.push_back(fmt::format("{} [{}]", quantity.title, quantity.unit));
    if (quantity.key == "success_rate") {
      table.titles.insert(table.titles.end(), {"IQM [%]", "worst 5 % [%]"});
    }
  }
  table.titles.insert(table.titles.end(), {"steps", "training"});
  for (const PublishedColumn& column : published) {
    const Quantity& quantity = kQuantities[column.quantity];
    table.titles.push_back(
        fmt::format("{}: {} [{}]", EscapeMarkdown(column.source), quantity.title, quantity.unit));
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const RowFigures& row = rows[i];
    std::vector<std::string>& cells = table.rows.emplace_back();
    cells.push_back(EscapeMarkdown(content.row(row).name));
    if (has_snapshots) {
      cells.push_back(snapshot_steps[i] > 0
                          ? base::FormatCount(static_cast<double>(snapshot_steps[i]))
                          : "the end");
    }
    cells.push_back(SeedsText(row, content.row(row).is_planner));
    for (std::size_t q = 0; q < row.quantities.size(); ++q) {
      cells.push_back(EstimateText(row.quantities[q].estimate, kQuantities[q].factor, 1));
      if (q != 0) continue;
      cells.push_back(EstimateText(row.interquartile_mean, 100.0, 1));
      cells.push_back(EstimateText(row.lowest_twentieth, 100.0, 1));
    }
    cells.push_back(StepsText(row));
    cells.push_back(row.training_s ? FormatSeconds(*row.training_s) : "–");
    for (const PublishedColumn& column : published) {
      cells.push_back(PublishedText(FindPublished(row, column), kQuantities[column.quantity]));
    }
  }
  return table.Print();
}

std::string PairTable(const ReportContent& content, const RowPairs& compared) {
  std::string text =
      "| first | second | difference [points] | p, courses | p, trainings | verdict | first better "
      "|\n|---|---|---:|---:|---:|---|---:|\n";
  for (const eval::AgentPair& pair : compared.pairs) {
    fmt::format_to(std::back_inserter(text), "| {} | {} | {} | {} | {} | {} | {} |\n",
                   EscapeMarkdown(content.results.rows[pair.first].title),
                   EscapeMarkdown(content.results.rows[pair.second].title),
                   EstimateText(pair.test.difference, 100.0, 1), PValueText(pair.corrected_p_value),
                   PValueText(pair.corrected_training_p_value), eval::ToString(pair.verdict),
                   EstimateText(pair.improvement, 1.0, 2));
  }
  return text;
}

std::string CurveTable(const ReportContent& content, const ScoreContent& score) {
  eval::MarkdownTable table{
      .titles = {"row", "seeds", "area over steps [%]", "area over seconds [%]"}};
  for (const LearningCurve& curve : score.curves) {
    table.rows.push_back({EscapeMarkdown(content.results.rows[curve.row].title),
                          fmt::format("{} of {}", curve.num_seeds, curve.num_planned),
                          EstimateText(curve.area_over_steps, 100.0, 1),
                          EstimateText(curve.area_over_seconds, 100.0, 1)});
  }
  return table.Print();
}

std::string ScoreText(const ReportContent& content, const ScoreContent& score) {
  std::string text = fmt::format("\n## {}\n\nCourses: {}. {}\n\n", EscapeMarkdown(score.label),
                                 EscapeMarkdown(score.courses), EscapeMarkdown(score.protocol));
  text += RowTable(content, score.rows, {});
  if (!score.best_row.empty()) text += "\n" + EscapeMarkdown(score.best_row) + "\n";
  if (!score.overlap.empty()) text += "\n" + EscapeMarkdown(score.overlap) + "\n";
  if (!score.snapshots.empty()) {
    text += "\n### While learning\n\n" + RowTable(content, score.snapshots, score.snapshot_steps);
  }
  if (!score.curves.empty()) {
    text +=
        "\nThe area under a curve of success is its mean height between its first and last "
        "snapshot.\n\n" +
        CurveTable(content, score);
  }
  if (!score.pairs.pairs.empty()) {
    text +=
        "\n### Row against row\n\nSuccess of the first minus that of the second on the same "
        "courses and starts. p-values are of permutation tests, corrected by Holm for the "
        "number of pairs: over courses for these trained policies, over trainings for the two "
        "ways to train. The verdict is that of the trainings, or that of the courses for two "
        "planners. The last column is how likely the first is better on a course.\n\n" +
        PairTable(content, score.pairs);
  }
  if (!score.pairs.note.empty()) text += "\n" + score.pairs.note + "\n";
  return text;
}

/// "**65.1 ± 4.0**"
std::string MarkdownCell(const GridCell& cell) {
  if (!cell.mean) return "–";
  std::string number = eval::FixedText(*cell.mean, 1);
  if (cell.deviation) number += " ± " + eval::FixedText(*cell.deviation, 1);
  if (cell.is_bold) number = "**" + number + "**";
  return cell.mark.empty() ? number : fmt::format("{} ({} seeds)", number, cell.mark);
}

/// A cell over several columns stands in the first of them.
std::string MarkdownCells(const std::vector<GridCell>& cells) {
  std::string text;
  for (const GridCell& cell : cells) {
    text += " " + MarkdownCell(cell) + " |";
    for (int i = 1; i < cell.num_columns; ++i) text += " |";
  }
  return text + "\n";
}

std::string GridTable(const Grid& grid) {
  std::string text = "\n| " + EscapeMarkdown(grid.corner) + " |";
  std::string rule = "|---|";
  for (const GridBlock& block : grid.blocks) {
    for (const std::string& column : block.columns) {
      const std::string head = block.head.empty() ? column : block.head + ", " + column;
      text += " " + EscapeMarkdown(head) + " |";
      rule += "---:|";
    }
  }
  text += "\n" + rule + "\n";
  for (const GridLine& line : grid.lines) {
    text += "| " + EscapeMarkdown(line.head) + " |" + MarkdownCells(line.cells);
    for (const auto& [source, cells] : line.published) {
      text += "| *" + EscapeMarkdown(source) + "* |" + MarkdownCells(cells);
    }
  }
  return text + "\n" + EscapeMarkdown(grid.caption) + "\n";
}

std::string ProvenanceText(const ReportContent& content) {
  std::string text;
  for (const auto& [name, value] : content.provenance) {
    text += fmt::format("- {}: {}\n", name, EscapeMarkdown(value));
  }
  for (const std::string& warning : content.warnings) {
    text += fmt::format("\n**Note:** {}\n", EscapeMarkdown(warning));
  }
  return text;
}

/// "GRU / 4 less MLP / 1 on static-test: success -3.8 (-6.1–-1.5) points, above 0?"
std::string FigureText(const ReportContent& content, const Conclusion& conclusion,
                       const ConclusionFigure& figure) {
  const Quantity& quantity = FindQuantity(conclusion.quantity);
  const auto on = [&](const std::string& row, const std::string& name) {
    const auto score = std::ranges::find(content.scores, name, &ScoreContent::name);
    return fmt::format("{} on {}", row, score->label);
  };
  std::string text = EscapeMarkdown(
      figure.than.empty() ? on(figure.row, conclusion.score)
      : conclusion.than_score.empty()
          ? on(fmt::format("{} less {}", figure.row, figure.than), conclusion.score)
          : on(figure.row, conclusion.score) + " less " + on(figure.than, conclusion.than_score));
  const std::string_view unit = quantity.is_rate && !figure.than.empty() ? "points" : quantity.unit;
  if (!figure.estimate) return text + ": –";
  fmt::format_to(std::back_inserter(text), ": {} {} {}", quantity.title,
                 EstimateText(figure.estimate, quantity.factor, 1), unit);
  return text;
}

std::string LimitText(const Conclusion& conclusion) {
  const Quantity& quantity = FindQuantity(conclusion.quantity);
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

/// The new text of a block; none: it is of another plan.
std::optional<std::string> BlockText(const std::string& kind, const std::string& name,
                                     std::span<const ReportContent> contents) {
  if (kind == "conclusions") return MarkdownConclusions(contents);
  for (const ReportContent& content : contents) {
    if (content.plan.sweep.name != name) continue;
    return kind == "table" ? MarkdownTable(content) : "\n" + MarkdownSummary(content);
  }
  return std::nullopt;
}

}  // namespace

std::string MarkdownTable(const ReportContent& content) {
  const std::vector<Grid> grids = MakeGrids(content);
  return grids.empty() ? "" : GridTable(grids.front());
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
      table.rows.push_back({EscapeMarkdown(judged.conclusion.text),
                            fmt::format("{}", fmt::join(figures, "<br>")),
                            LimitText(judged.conclusion), std::string(ToString(judged.verdict))});
    }
  }
  return "\n" + table.Print();
}

std::string MarkdownSummary(const ReportContent& content) {
  std::string text = ProvenanceText(content);
  for (const Grid& grid : MakeGrids(content)) text += GridTable(grid);
  return text;
}

std::string MarkdownReport(const ReportContent& content) {
  std::string text =
      fmt::format("# {}\n\n", EscapeMarkdown(content.title)) + MarkdownSummary(content);
  if (!content.conclusions.empty()) text += MarkdownConclusions(std::span(&content, 1));
  text +=
      "\nIn brackets 95 % intervals over seeds and courses; with one seed over courses alone. IQM "
      "is the mean of the middle half of all success rates by seed and course, and *worst 5 %* "
      "that of the lowest twentieth. Survival is the time of failed episodes, traversal that of "
      "successful ones.\n";
  for (const ScoreContent& score : content.scores) text += ScoreText(content, score);
  return text + MissingText(content);
}

std::string FillBlocks(const std::string& page, const std::string& source,
                       std::span<const ReportContent> contents) {
  constexpr std::string_view kBegin = "<!-- sweep ";
  constexpr std::string_view kEnd = "<!-- end of sweep -->";
  std::istringstream lines(page);
  std::string text;
  std::string line;
  bool has_filled = false;
  for (int number = 1; std::getline(lines, line); ++number) {
    text += line + "\n";
    if (!line.starts_with(kBegin)) continue;
    const auto require = [&](bool condition, const std::string& what) {
      if (!condition) throw base::Error(fmt::format("{}:{}: {}", source, number, what));
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
  throw base::Error(
      fmt::format("{}: has no block of these plans, expected a line such as \"{}table {} -->\"",
                  source, kBegin, contents.front().plan.sweep.name));
}

}  // namespace slalom::sweep
