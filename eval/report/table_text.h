#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "eval/statistics/statistics.h"

/// Tables of estimates in Markdown and CSV, and text as a cell of one, whatever characters it has.

namespace slalom::eval {

/// Returns the number with `digits` decimals, rounded to the nearest. Halves are rounded away from
/// zero ("36.3" for 36.25), as the scripts of pages do, so every form of a report has one text. One
/// that is rounded to zero has no sign. Requires: value finite, 0 <= digits <= 9.
std::string FixedText(double value, int digits);

/// Returns "93.5 (90.1–96.0)", "1.5 (-0.5 to 3.5)", or "+1.5 (-0.5 to +3.5)" for a difference; "–"
/// if there is none.
std::string EstimateText(const std::optional<Estimate>& estimate, double factor, int digits,
                         bool is_difference = false);

/// Returns "0.125", "\\< 0.001" or, if there is none, "–".
std::string PValueText(const std::optional<double>& p);

/// A table as Markdown. A value.
struct MarkdownTable {
  std::vector<std::string> titles;
  std::size_t num_names = 1;  ///< Columns from the left that hold names; the others hold numbers.
  std::vector<std::vector<std::string>> rows{};  ///< Cells, as many as titles, already escaped.

  std::string Print() const;
  /// For a terminal: cells are padded to the width of their column.
  std::string PrintAligned() const;
};

/// Returns "value,low,high" with six decimals. Numbers that do not exist are empty.
std::string CsvEstimate(const std::optional<Estimate>& estimate);

/// Escapes characters that Markdown would read as its own. Line breaks become spaces.
std::string EscapeMarkdown(std::string_view text);

/// Returns the text as code in a cell of a Markdown table; escaped instead if code cannot hold it.
std::string MarkdownCode(std::string_view text);

}  // namespace slalom::eval
