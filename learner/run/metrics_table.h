#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace slalom::run {

/// The rows of a metrics.csv or curve.csv by column. A value.
struct MetricsTable {
  std::vector<std::string> names;
  std::vector<std::vector<double>> columns;  ///< One for each name, alike in size. NaN: empty.

  std::size_t num_rows() const { return columns.empty() ? 0 : columns.front().size(); }
  /// The values of a column. Where there is no such column, NaN for each row.
  std::vector<double> Column(std::string_view name) const;
  /// The last value of a column; NaN: there is none.
  double Last(std::string_view name) const;
};

/// The cells of a line without its end.
std::vector<std::string_view> SplitCells(std::string_view line);
/// The names of a header line. Names that earlier versions wrote become those of today.
std::vector<std::string> SplitNames(std::string_view line);

/// The table in `text`, however much of it is there: a last line without its end, and lines that do
/// not have a number or nothing in each cell, are left out. `max_rows` > 1: of more rows than this,
/// so many are kept, evenly spread, the last one among them.
MetricsTable ParseMetrics(std::string_view text, std::size_t max_rows);

/// The last few rows of a metrics.csv, which may be long and still be written: only its ends are
/// read. No rows: there is no such file, or no whole row in it.
MetricsTable ReadLastMetrics(const std::filesystem::path& path);

}  // namespace slalom::run
