#include "learner/run/metrics_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/file.h"
#include "base/log.h"
#include "base/progress.h"
#include "learner/run/metrics_table.h"

namespace slalom::run {
namespace {

struct Column {
  std::string_view name;
  std::string text;    // Its cell; empty: not known.
  std::string tag;     // In the event file.
  double value = 0.0;  // NaN: not known.
};

/// Makes the columns of a row.
struct ListColumns {
  template <class Number>
  void operator()(std::string_view name, Number value, std::string_view /*meaning*/,
                  const char* format = std::is_integral_v<Number> ? "{}" : "{:.6g}") {
    const auto number = static_cast<double>(value);
    columns.push_back({name, std::isnan(number) ? "" : fmt::format(fmt::runtime(format), value),
                       fmt::format("training/{}", name), number});
  }
  std::vector<Column> columns;
};

/// Every column, in the file's order.
std::vector<Column> Columns(MetricsRow row) {
  ListColumns list;
  row.Visit(list);
  return std::move(list.columns);
}

/// One line: the names, or the cells.
std::string Line(const std::vector<Column>& columns, bool names) {
  std::string line;
  for (const Column& column : columns) {
    line += names ? column.name : column.text;
    line += ',';
  }
  line.back() = '\n';
  return line;
}

/// The rows of an earlier metrics file up to a step, without a half-written last line. Cells go to
/// the columns of their names.
std::string KeptRows(const std::filesystem::path& path, std::int64_t keep_until_step) {
  const std::vector<Column> columns = Columns({});
  std::string kept = Line(columns, true);
  if (keep_until_step <= 0 || !std::filesystem::exists(path)) return kept;
  std::istringstream lines(base::ReadTextFile(path));
  std::string head;
  std::getline(lines, head);
  const std::vector<std::string_view> names = SplitCells(head);
  for (std::string line; std::getline(lines, line);) {
    const std::vector<std::string_view> cells = SplitCells(line);
    if (cells.size() != names.size() || lines.eof()) continue;
    std::vector<Column> row = columns;
    for (Column& column : row) {
      const auto it = std::find(names.begin(), names.end(), column.name);
      column.text = it == names.end() ? "" : cells[static_cast<std::size_t>(it - names.begin())];
    }
    const auto steps = std::strtoll(row[1].text.c_str(), nullptr, 10);
    if (steps > 0 && steps <= keep_until_step) kept += Line(row, false);
  }
  return kept;
}

std::string Percent(double rate) {
  return std::isnan(rate) ? "  -" : fmt::format("{:3.0f}%", 100.0 * rate);
}

}  // namespace

std::string FormatProgress(const MetricsRow& row, double remaining_s) {
  return fmt::format("{} steps ({}/s)  {} updates/s  success {}  collision {}  left {}",
                     base::FormatCount(static_cast<double>(row.steps)),
                     base::FormatCount(row.steps_per_s), base::FormatCount(row.updates_per_s),
                     Percent(row.success_rate), Percent(row.collision_rate),
                     std::isnan(remaining_s) ? "?" : base::FormatDuration(remaining_s));
}

MetricsLog::MetricsLog(const std::filesystem::path& path, std::int64_t keep_until_step) {
  base::WriteFileAtomically(path, KeptRows(path, keep_until_step));
  file_.emplace(path, base::AppendFile::Mode::kGoOn);
  events_.emplace(path.parent_path(), keep_until_step + 1);
}

void MetricsLog::Append(const MetricsRow& row) {
  const std::vector<Column> columns = Columns(row);
  std::vector<Scalar> scalars;
  scalars.reserve(columns.size());
  for (const Column& column : columns) scalars.push_back({column.tag, column.value});
  auto failure = file_->Append(Line(columns, false));
  if (!failure) failure = events_->Append(row.steps, scalars);
  if (failure && !failing_) spdlog::error("{}; rows are left out until it can", failure->text);
  failing_ = failure.has_value();
}

}  // namespace slalom::run
