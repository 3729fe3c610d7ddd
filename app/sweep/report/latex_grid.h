#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/sweep/report/report_content.h"

/// A table of numbers with their deviations, in LaTeX.

namespace slalom::sweep {

/// One number of a table, as it is printed: in percent or seconds.
struct GridCell {
  std::optional<double> mean;  ///< None: a dash.
  std::optional<double> deviation;
  std::string mark;     ///< Above the number: "2/3". May be empty.
  int num_columns = 1;  ///< That it spans.
  bool is_bold = false;
};

/// One line of a table.
struct GridLine {
  std::string head;  ///< LaTeX.
  std::vector<GridCell> cells;
  /// Published numbers, on a line of their own below. None of them is bold.
  struct PublishedLine {
    std::string source;
    std::vector<GridCell> cells;
  };
  std::vector<PublishedLine> published;
};

/// Neighbouring columns under one head.
struct GridBlock {
  std::string head;  ///< LaTeX. Empty: none of the blocks has a head.
  std::vector<std::string> columns;
};

/// A table.
struct Grid {
  std::string corner;
  std::vector<GridBlock> blocks;
  std::vector<GridLine> lines;
  std::string caption;
  std::string label;
};

/// "$65.1 \pm 4.0$"
std::string LatexCell(const GridCell& cell);

/// Returns the table, with booktabs and multirow.
std::string PrintGrid(const Grid& grid);

/// Makes the best number of `cells` bold, and those that print alike; null pointers are passed
/// over. Nothing is bold if all numbers print alike.
void EmboldenBest(const std::vector<GridCell*>& cells, bool higher_is_better);

}  // namespace slalom::sweep
