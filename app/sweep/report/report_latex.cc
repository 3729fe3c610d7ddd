#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <string_view>
#include <utility>

#include "app/sweep/report/grid.h"
#include "app/sweep/report/report.h"
#include "eval/report/table_text.h"

namespace slalom::sweep {
namespace {

using eval::EscapeLatex;

/// Text of a grid. Arrows become LaTeX's.
std::string LatexText(const std::string& text) {
  std::string latex = EscapeLatex(text);
  for (const auto& [arrow, command] : {std::pair{"↑", "$\\uparrow$"}, {"↓", "$\\downarrow$"}}) {
    for (std::size_t at = latex.find(arrow); at != std::string::npos; at = latex.find(arrow)) {
      latex.replace(at, std::string_view(arrow).size(), command);
    }
  }
  return latex;
}

/// The head of a column. "H=4", the axis by at most two characters, becomes a formula.
std::string LatexColumn(const std::string& head) {
  const std::size_t equals = head.find('=');
  const bool is_formula = equals == 1 || equals == 2;
  return is_formula ? "$" + EscapeLatex(head) + "$" : LatexText(head);
}

/// "$65.1 \pm 4.0$"
std::string LatexCell(const GridCell& cell) {
  if (!cell.mean) return "-";
  std::string number = eval::FixedText(*cell.mean, 1);
  if (cell.deviation) number += " \\pm " + eval::FixedText(*cell.deviation, 1);
  if (cell.is_bold) number = "\\boldsymbol{" + number + "}";
  if (!cell.mark.empty()) number += "^{" + cell.mark + "}";
  return "$" + number + "$";
}

std::string LatexCells(const std::vector<GridCell>& cells) {
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
  std::string heads = fmt::format("  \\multirow{{2}}{{*}}{{{}}}", LatexText(grid.corner));
  std::string rules = " ";
  std::size_t first = 2;
  for (const GridBlock& block : grid.blocks) {
    const std::size_t last = first + block.columns.size() - 1;
    fmt::format_to(std::back_inserter(heads), " & \\multicolumn{{{}}}{{c}}{{\\texttt{{{}}}}}",
                   block.columns.size(), LatexText(block.head));
    fmt::format_to(std::back_inserter(rules), " \\cmidrule(lr){{{}-{}}}", first, last);
    first = last + 1;
  }
  return heads + " \\\\\n" + rules + "\n  ";
}

std::string PrintGrid(const Grid& grid) {
  std::size_t num_columns = 0;
  for (const GridBlock& block : grid.blocks) num_columns += block.columns.size();
  std::string text =
      fmt::format("\\begin{{table*}}[!htb]\n\\centering\n\\begin{{tabular}}{{l{}}}\n\\toprule\n",
                  std::string(num_columns, 'c'));
  const bool has_heads =
      std::ranges::any_of(grid.blocks, [](const GridBlock& block) { return !block.head.empty(); });
  text += has_heads ? BlockHeads(grid) : "  " + LatexText(grid.corner);
  for (const GridBlock& block : grid.blocks) {
    for (const std::string& column : block.columns) text += " & " + LatexColumn(column);
  }
  text += " \\\\ \\midrule\n";
  for (const GridLine& line : grid.lines) {
    text += LatexText(line.head) + LatexCells(line.cells);
    for (const auto& [source, cells] : line.published) {
      text += "\\quad \\textit{" + EscapeLatex(source) + "}" + LatexCells(cells);
    }
  }
  fmt::format_to(
      std::back_inserter(text),
      "\\bottomrule\n\\end{{tabular}}\n\\caption{{{}}}\n\\label{{{}}}\n\\end{{table*}}\n\n",
      LatexText(grid.caption), grid.label);
  return text;
}

}  // namespace

std::string LatexReport(const ReportContent& content) {
  std::string text = "% Needs \\usepackage{amsmath, booktabs, multirow}.\n";
  for (const auto& [name, value] : content.provenance) {
    std::string line = fmt::format("% {}: {}", name, value);
    std::ranges::replace(line, '\n', ' ');
    text += line + "\n";
  }
  text += "\n";
  for (const Grid& grid : MakeGrids(content)) text += PrintGrid(grid);
  return text;
}

}  // namespace slalom::sweep
