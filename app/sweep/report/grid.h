#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/sweep/report/report_content.h"

/// Tables of numbers with their deviations, laid out as papers have them. They hold plain text;
/// report.h prints them.

namespace slalom::sweep {

/// One number of a table, as it is printed: in percent or seconds.
struct GridCell {
  std::optional<double> mean;  ///< Empty for a dash.
  std::optional<double> deviation;
  std::string mark;     ///< Above the number: "2/3". May be empty.
  int num_columns = 1;  ///< Number of columns the cell spans.
  bool is_bold = false;
};

/// One line of a table.
struct GridLine {
  std::string head;
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
  std::string head;  ///< Empty if none of the blocks has a head.
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

/// Lays out the tables of a report: mean and standard deviation over seeds, the best in bold, and
/// below each line the published numbers.
///
/// If rows have two labels or more, the last one gives the columns, the scores their heads, and the
/// others the lines; each quantity has its table. If rows have one label, each score has a table:
/// rows side by side and quantities below one another, or the other way round if there are more
/// than seven rows; with `sweep.quantities`, each of these has a table with the scores side by
/// side, or below one another if they are many. If snapshots were scored, another table has their
/// steps as columns.
std::vector<Grid> MakeGrids(const ReportContent& content);

}  // namespace slalom::sweep
