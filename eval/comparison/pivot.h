#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "eval/comparison/comparison.h"

/// Cross tables as papers have them: a number for each line and column.

namespace slalom::eval {

/// A number as it is printed, in percent or seconds.
struct PivotNumber {
  std::optional<double> mean;  ///< Empty for a dash.
  std::optional<double> deviation{};
};

/// One number and its place.
struct PivotEntry {
  std::size_t line = 0;  ///< Index in `Pivot::lines`, as the others are.
  std::size_t block = 0;
  std::optional<std::size_t> column{};  ///< Empty: the number is of all columns of its block.
  PivotNumber number{};
  std::string mark{};       ///< "2/3": the share of the planned seeds. May be empty.
  std::size_t contest = 0;  ///< The best of one contest is bold.
  bool higher_is_better = true;
  /// Published numbers by source, on lines of their own below.
  std::vector<std::pair<std::string, PivotNumber>> published{};
};

/// The heads of a number. No column: the number is of all columns of its block.
struct PivotPlace {
  std::string line;
  std::string block{};
  std::optional<std::string> column{};
};

/// A table. Heads without an entry are not printed.
struct Pivot {
  /// Adds a quantity of an agent: the mean over its seeds, their deviation, and published numbers.
  /// Heads join the table in the order in which they come. `agent`: null to add the heads alone.
  void Add(const PivotPlace& place, const AgentFigures* agent, std::size_t quantity,
           std::size_t contest);

  std::string corner;
  std::vector<std::string> lines{};
  std::vector<std::string> blocks{""};  ///< Each has all columns.
  std::vector<std::string> columns{};
  std::vector<PivotEntry> entries{};
  std::string caption{};
};

/// The most columns that fit across a page.
inline constexpr std::size_t kMaxPivotColumns = 12;

/// Exchanges lines and columns if the columns are too many for a page and more than the lines.
/// Requires: at most one block, and a column for each entry.
void FitToPage(Pivot& pivot);

/// Returns the table with its caption. The best number of each contest is bold, and those that
/// print alike, unless all of them do. The caption says what deviations, marks and italics mean if
/// there are any.
std::string MarkdownOf(const Pivot& pivot);

}  // namespace slalom::eval
