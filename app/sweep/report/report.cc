#include "app/sweep/report/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <optional>
#include <span>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "app/sweep/store.h"
#include "base/error.h"
#include "base/file.h"
#include "eval/comparison/printers.h"
#include "eval/report/table_text.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;

using eval::EscapeMarkdown;
using eval::EstimateText;

std::string CurveText(const ScoreContent& score) {
  eval::MarkdownTable table{
      .titles = {"row", "seeds", "area over steps [%]", "area over seconds [%]"}};
  for (const LearningCurve& curve : score.curves) {
    table.rows.push_back({EscapeMarkdown(score.group.agents[curve.agent].label),
                          fmt::format("{} of {}", curve.num_seeds, curve.num_planned),
                          EstimateText(curve.area_over_steps, 100.0, 1),
                          EstimateText(curve.area_over_seconds, 100.0, 1)});
  }
  return "\nThe area under a curve of success is its mean height between its first and last "
         "snapshot.\n\n" +
         table.Print();
}

std::string ScoreText(const ScoreContent& score) {
  const eval::Group& group = score.group;
  std::string text = fmt::format("\n## {}\n\nCourses: {}. {}\n\n{}", EscapeMarkdown(score.label),
                                 EscapeMarkdown(score.courses), EscapeMarkdown(group.protocol),
                                 eval::FiguresTable(group.agents, group.columns).Print());
  for (const std::string& note : group.notes) text += "\n" + EscapeMarkdown(note) + "\n";
  if (!score.snapshots.empty()) {
    text += "\n### While learning\n\n" + eval::FiguresTable(score.snapshots, group.columns).Print();
  }
  if (!score.curves.empty()) text += CurveText(score);
  if (!group.pairs.empty()) text += "\n### Row against row\n\n" + eval::PairTable(group).Print();
  return text;
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
  if (!content.missing.empty()) text += "\n## Missing\n\n";
  for (const std::string& missing : content.missing) text += "- " + EscapeMarkdown(missing) + "\n";
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

/// The source of the numbers, and the cross tables.
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
  for (const ScoreContent& score : content.scores) text += ScoreText(score);
  return text + MissingText(content);
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
  const std::vector<Row>& rows = content.results.rows;
  const bool by_score = content.scores.size() > rows.size();
  std::size_t height = 1 + rows.size();
  std::size_t width = 1 + content.scores.size();
  if (by_score) std::swap(height, width);
  std::vector<std::vector<std::string>> lines(height, std::vector<std::string>(width));
  const auto cell = [&](std::size_t row, std::size_t score) -> std::string& {
    return by_score ? lines[score][row] : lines[row][score];
  };
  cell(0, 0) = "success [%]";
  for (std::size_t r = 0; r < rows.size(); ++r) cell(1 + r, 0) = rows[r].title;
  for (std::size_t s = 0; s < content.scores.size(); ++s) {
    const ScoreContent& score = content.scores[s];
    cell(0, 1 + s) = score.label;
    for (std::size_t i = 0; i < score.rows.size(); ++i) {
      cell(1 + score.rows[i], 1 + s) = SummaryCell(score.group.agents[i]);
    }
  }
  return eval::MarkdownTable{.titles = lines.front(), .rows = {lines.begin() + 1, lines.end()}}
      .PrintAligned();
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
