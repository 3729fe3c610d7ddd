#include "app/sweep/report/report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <vector>

#include "app/sweep/report/cross_tables.h"
#include "app/sweep/store.h"
#include "base/config_field.h"
#include "base/file.h"
#include "base/progress.h"
#include "eval/comparison/printers.h"
#include "eval/report/table_text.h"

namespace slalom::sweep {
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
std::string FiguresText(std::span<const eval::AgentFigures> agents,
                        std::span<const TrainingFigures> trainings,
                        std::span<const std::size_t> columns) {
  eval::MarkdownTable table = eval::FiguresTable(agents, columns);
  table.titles.insert(table.titles.end(), {"steps", "training"});
  for (std::size_t i = 0; i < agents.size(); ++i) {
    table.rows[i].push_back(StepsText(trainings[i]));
    table.rows[i].push_back(trainings[i].training_s ? base::FormatDuration(*trainings[i].training_s)
                                                    : "–");
  }
  return table.Print();
}

std::string SnapshotText(const ScoreContent& score) {
  std::vector<eval::AgentFigures> agents;
  std::vector<TrainingFigures> trainings;
  for (const Snapshot& snapshot : score.snapshots) {
    agents.push_back(snapshot.agent);
    trainings.push_back(snapshot.training);
  }
  return "\n### While learning\n\n" + FiguresText(agents, trainings, score.group.columns);
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
                                 FiguresText(group.agents, score.trainings, group.columns));
  for (const std::string& note : group.notes) text += "\n" + EscapeMarkdown(note) + "\n";
  if (!score.snapshots.empty()) text += SnapshotText(score);
  if (!score.curves.empty()) text += CurveText(content, score);
  if (!group.pairs.empty()) {
    text += "\n### Row against row\n\n" + eval::PairTable(group).Print();
  }
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
                     EstimateText(figure.estimate, quantity.factor, 1),
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
      table.rows[score.rows[i]].back() = SummaryCell(score.group.agents[i]);
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
      table.rows.push_back({EscapeMarkdown(judged.conclusion.text),
                            fmt::format("{}", fmt::join(figures, "<br>")),
                            LimitText(judged.conclusion), std::string(ToString(judged.verdict))});
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

}  // namespace slalom::sweep
