#include "app/sweep/report/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "app/sweep/store.h"
#include "base/file.h"
#include "eval/report/table_text.h"
#include "eval/statistics/bootstrap.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;

/// How many characters a terminal shows for a UTF-8 text.
std::size_t WidthOf(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xc0u) != 0x80u; }));
}

/// "74.2 (70.1 - 78.0)", and the number of its seeds if some are missing.
std::string SummaryCell(const RowScore& score) {
  if (score.seeds.empty()) return "-";
  const eval::Estimate success = eval::BootstrapMean(RateTable(score, kQuantities[0]));
  std::string text = eval::FixedText(100.0 * success.value, 1);
  if (success.interval) {
    text += fmt::format(" ({} - {})", eval::FixedText(100.0 * success.interval->low, 1),
                        eval::FixedText(100.0 * success.interval->high, 1));
  }
  if (!score.is_complete()) {
    text += fmt::format(", {} of {} seeds", score.seeds.size(), score.num_planned);
  }
  return text;
}

/// The columns of a table of text as its lines.
std::vector<std::vector<std::string>> Transposed(
    const std::vector<std::vector<std::string>>& table) {
  std::vector<std::vector<std::string>> columns(table[0].size());
  for (const auto& line : table) {
    for (std::size_t i = 0; i < line.size(); ++i) columns[i].push_back(line[i]);
  }
  return columns;
}

}  // namespace

void WriteSweepReport(const ReportContent& content, const fs::path& store) {
  const fs::path directory = PlanDirectory(store, content.plan.sweep.name);
  base::MakeDirectories(directory);
  base::WriteFileAtomically(directory / "report.csv", CellCsv(content));
  base::WriteFileAtomically(directory / "report-rows.csv", RowCsv(content));
  base::WriteFileAtomically(directory / "report.tex", LatexReport(content));
  base::WriteFileAtomically(directory / "report.md", MarkdownReport(content));
  base::WriteFileAtomically(directory / "report.html", SweepPage(content));
}

std::string SweepSummary(const SweepResults& results) {
  std::vector<std::vector<std::string>> table(1 + results.rows.size());
  table[0].push_back("success [%]");
  for (std::size_t r = 0; r < results.rows.size(); ++r) {
    table[r + 1].push_back(results.rows[r].title);
  }
  for (const ScoreResults& score : results.scores) {
    table[0].push_back(score.label);
    for (std::size_t r = 0; r < results.rows.size(); ++r) {
      const auto found = std::ranges::find(score.rows, r, &RowScore::row);
      table[r + 1].push_back(found == score.rows.end() ? "" : SummaryCell(*found));
    }
  }
  if (table[0].size() > table.size()) table = Transposed(table);
  std::string text;
  for (std::size_t line = 0; line < table.size(); ++line) {
    std::string rule;
    for (std::size_t column = 0; column < table[line].size(); ++column) {
      std::size_t width = 0;
      for (const auto& other : table) width = std::max(width, WidthOf(other[column]));
      const std::string& cell = table[line][column];
      text += "| " + cell + std::string(width - WidthOf(cell) + 1, ' ');
      rule += "|" + std::string(width + 2, '-');
    }
    text += "|\n";
    if (line == 0) text += rule + "|\n";
  }
  return text;
}

}  // namespace slalom::sweep
