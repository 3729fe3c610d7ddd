#include "learner/run/metrics_table.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <optional>
#include <string>

#include "base/check.h"
#include "base/split.h"

namespace slalom::run {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
// A file up to this size is read as a whole, and of a longer one pieces that hold a row each.
constexpr std::streamoff kWholeFile = 1 << 20;
constexpr std::streamoff kPiece = 4096;

/// The numbers of a line; none: it is not a whole row.
std::optional<std::vector<double>> ParseRow(std::string_view line, std::size_t num_columns) {
  const std::vector<std::string_view> cells = SplitCells(line);
  if (cells.size() != num_columns) return std::nullopt;
  std::vector<double> numbers;
  for (const std::string_view cell : cells) {
    const auto number = cell.empty() ? kNone : base::ParseNumber<double>(cell);
    if (!number) return std::nullopt;
    numbers.push_back(*number);
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

MetricsTable ReadMetrics(const std::filesystem::path& path, std::size_t max_rows) {
  SLALOM_CHECK_GT(max_rows, 1u);
  std::ifstream file(path);
  std::string text;
  if (!std::getline(file, text)) return {};
  text += '\n';
  const std::streamoff begin = file.tellg();
  file.seekg(0, std::ios::end);
  const std::streamoff size = file.tellg() - begin;
  if (size <= kWholeFile) {
    file.seekg(begin);
    text.append(std::istreambuf_iterator<char>(file), {});
    return ParseMetrics(text, max_rows);
  }
  std::string piece(kPiece, '\0');
  for (std::size_t i = 0; i < max_rows; ++i) {
    const bool is_last = i + 1 == max_rows;
    const auto share = static_cast<double>(i) / static_cast<double>(max_rows - 1);
    const auto offset = static_cast<std::streamoff>(share * static_cast<double>(size - kPiece));
    file.clear();
    file.seekg(begin + offset);
    file.read(piece.data(), kPiece);
    std::string_view rows(piece.data(), static_cast<std::size_t>(file.gcount()));
    // A piece begins in the middle of a row, and the last one may end in the middle of one.
    if (offset > 0) rows.remove_prefix(std::min(rows.size(), rows.find('\n') + 1));
    rows = rows.substr(0, rows.rfind('\n') + 1);
    if (is_last && !rows.empty()) {
      rows.remove_prefix(rows.substr(0, rows.size() - 1).rfind('\n') + 1);
    }
    text += rows.substr(0, rows.find('\n') + 1);
  }
  return ParseMetrics(text, max_rows);
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
