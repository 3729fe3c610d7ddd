#include "learner/run/metrics_table.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <system_error>

namespace slalom::run {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// The numbers of a line; none: it is not a whole row.
std::optional<std::vector<double>> ParseRow(std::string_view line, std::size_t num_columns) {
  const std::vector<std::string_view> cells = SplitCells(line);
  if (cells.size() != num_columns) return std::nullopt;
  std::vector<double> numbers;
  for (const std::string_view cell : cells) {
    double number = kNone;
    if (!cell.empty()) {
      const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), number);
      if (error != std::errc{} || end != cell.data() + cell.size()) return std::nullopt;
    }
    numbers.push_back(number);
  }
  return numbers;
}

/// Keeps `max_rows` of the rows.
void Thin(MetricsTable& table, std::size_t max_rows) {
  const std::size_t num_rows = table.num_rows();
  if (num_rows <= max_rows) return;
  for (std::vector<double>& column : table.columns) {
    for (std::size_t i = 0; i < max_rows; ++i) {
      column[i] = column[i * (num_rows - 1) / (max_rows - 1)];
    }
    column.resize(max_rows);
  }
}

}  // namespace

std::vector<std::string_view> SplitCells(std::string_view line) {
  std::vector<std::string_view> cells;
  while (true) {
    const auto comma = line.find(',');
    cells.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

std::vector<double> MetricsTable::Column(std::string_view name) const {
  const auto it = std::find(names.begin(), names.end(), name);
  if (it == names.end()) return std::vector<double>(num_rows(), kNone);
  return columns[static_cast<std::size_t>(it - names.begin())];
}

double MetricsTable::Last(std::string_view name) const {
  const auto it = std::find(names.begin(), names.end(), name);
  if (it == names.end() || num_rows() == 0) return kNone;
  return columns[static_cast<std::size_t>(it - names.begin())].back();
}

MetricsTable ParseMetrics(std::string_view text, std::size_t max_rows) {
  MetricsTable table;
  for (std::size_t end = 0; (end = text.find('\n')) != std::string_view::npos;) {
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end + 1);
    if (table.names.empty()) {
      const std::vector<std::string_view> names = SplitCells(line);
      table.names.assign(names.begin(), names.end());
      table.columns.resize(table.names.size());
      continue;
    }
    const auto row = ParseRow(line, table.names.size());
    if (!row) continue;
    for (std::size_t i = 0; i < row->size(); ++i) table.columns[i].push_back((*row)[i]);
  }
  if (max_rows > 1) Thin(table, max_rows);
  return table;
}

MetricsTable ReadLastMetrics(const std::filesystem::path& path) {
  constexpr std::streamoff kTail = 2000;
  std::ifstream file(path);
  std::string head;
  if (!std::getline(file, head)) return {};
  const std::streamoff begin = file.tellg();
  file.seekg(0, std::ios::end);
  const std::streamoff end = file.tellg();
  file.seekg(std::max(begin, end - kTail));
  std::string rows(std::istreambuf_iterator<char>(file), {});
  // A row that the tail cuts off begins in its middle.
  if (end - kTail > begin) rows.erase(0, std::min(rows.size(), rows.find('\n') + 1));
  return ParseMetrics(head + "\n" + rows, 0);
}

}  // namespace slalom::run
