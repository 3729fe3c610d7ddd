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
  std::vector<std::vector<double>> columns;  ///< One for each name, of equal size. NaN if empty.

  std::size_t num_rows() const { return columns.empty() ? 0 : columns.front().size(); }
  /// The values of a column, or NaN for each row if there is no such column.
  std::vector<double> Column(std::string_view name) const;
  /// The last value of a column, or NaN if there is none.
  double Last(std::string_view name) const;
};

/// Splits a line without its end into cells.
std::vector<std::string_view> SplitCells(std::string_view line);

/// Parses the table in `text`, which may be incomplete. Leaves out a last line without its end, and
/// lines with a cell that is neither empty nor a number. Keeps at most `max_rows` > 1 rows, evenly
/// spread, including the last.
MetricsTable ParseMetrics(std::string_view text, std::size_t max_rows);

/// Reads a metrics.csv, which may be long and still be written, as `ParseMetrics` does. Of a file
/// of more than 1 MiB it reads only its beginning, its end and rows at evenly spread places, so the
/// cost does not grow with the file. Returns no rows if there is no such file, or no whole row in
/// it. Requires: max_rows > 1.
MetricsTable ReadMetrics(const std::filesystem::path& path, std::size_t max_rows);

/// Reads the last few rows of a metrics.csv, which may be long and still be written: reads only its
/// beginning and end. Returns no rows if there is no such file, or no whole row in it.
MetricsTable ReadLastMetrics(const std::filesystem::path& path);

}  // namespace slalom::run
