#include "app/sweep/report/latex_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "eval/report/table_text.h"

namespace slalom::sweep {
namespace {

double Rounded(double value) { return std::round(10.0 * value); }

std::string CellsText(const std::vector<GridCell>& cells) {
  std::string text;
  for (const GridCell& cell : cells) {
    text += " & ";
    text += cell.num_columns > 1
                ? fmt::format("\\multicolumn{{{}}}{{c}}{{{}}}", cell.num_columns, LatexCell(cell))
                : LatexCell(cell);
  }
  return text + " \\\\\n";
}

/// The heads of blocks with a rule under each, and the line that begins the heads of columns.
std::string BlockHeads(const Grid& grid) {
  std::string heads = fmt::format("  \\multirow{{2}}{{*}}{{{}}}", grid.corner);
  std::string rules = " ";
  std::size_t first = 2;
  for (const GridBlock& block : grid.blocks) {
    const std::size_t last = first + block.columns.size() - 1;
    fmt::format_to(std::back_inserter(heads), " & \\multicolumn{{{}}}{{c}}{{{}}}",
                   block.columns.size(), block.head);
    fmt::format_to(std::back_inserter(rules), " \\cmidrule(lr){{{}-{}}}", first, last);
    first = last + 1;
  }
  return heads + " \\\\\n" + rules + "\n  ";
}

}  // namespace

std::string LatexCell(const GridCell& cell) {
  if (!cell.mean) return "-";
  std::string number = fmt::format("{:.1f}", *cell.mean);
  if (cell.deviation) number += fmt::format(" \\pm {:.1f}", *cell.deviation);
  if (cell.is_bold) number = "\\boldsymbol{" + number + "}";
  if (!cell.mark.empty()) number += "^{" + cell.mark + "}";
  return "$" + number + "$";
}

std::string PrintGrid(const Grid& grid) {
  std::size_t num_columns = 0;
  for (const GridBlock& block : grid.blocks) num_columns += block.columns.size();
  std::string text =
      fmt::format("\\begin{{table*}}[!htb]\n\\centering\n\\begin{{tabular}}{{l{}}}\n\\toprule\n",
                  std::string(num_columns, 'c'));
  const bool has_heads =
      std::ranges::any_of(grid.blocks, [](const GridBlock& block) { return !block.head.empty(); });
  text += has_heads ? BlockHeads(grid) : "  " + grid.corner;
  for (const GridBlock& block : grid.blocks) {
    for (const std::string& column : block.columns) text += " & " + column;
  }
  text += " \\\\ \\midrule\n";
  for (const GridLine& line : grid.lines) {
    text += line.head + CellsText(line.cells);
    for (const auto& [source, cells] : line.published) {
      text += "\\quad \\textit{" + eval::EscapeLatex(source) + "}" + CellsText(cells);
    }
  }
  fmt::format_to(
      std::back_inserter(text),
      "\\bottomrule\n\\end{{tabular}}\n\\caption{{{}}}\n\\label{{{}}}\n\\end{{table*}}\n\n",
      grid.caption, grid.label);
  return text;
}

void EmboldenBest(const std::vector<GridCell*>& cells, bool higher_is_better) {
  std::vector<GridCell*> numbers;
  for (GridCell* cell : cells) {
    if (cell && cell->mean) numbers.push_back(cell);
  }
  if (numbers.size() < 2) return;
  const double sign = higher_is_better ? 1.0 : -1.0;
  double best = sign * Rounded(*numbers.front()->mean);
  for (const GridCell* cell : numbers) best = std::max(best, sign * Rounded(*cell->mean));
  const auto is_best = [&](const GridCell* cell) { return sign * Rounded(*cell->mean) == best; };
  if (std::ranges::all_of(numbers, is_best)) return;
  for (GridCell* cell : numbers) cell->is_bold = is_best(cell);
}

}  // namespace slalom::sweep
