#include "eval/service/score_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "base/clock.h"
#include "base/error.h"
#include "base/file.h"
#include "base/split.h"
#include "eval/csv_field.h"

namespace slalom::eval {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kHeader =
    "unix_s,policy_version,courses,episodes,success_rate,success_low,success_high,collision_rate,"
    "timeout_rate,traversal_time_s,barn_score,evaluation_s,kept\n";
constexpr std::size_t kCourses = 2, kSuccessRate = 4;  // Columns.

std::vector<std::string_view> Split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

/// The rest of a line behind its first `num_cells` cells, which have no quotes.
std::string_view Behind(std::string_view line, std::size_t num_cells) {
  for (; num_cells > 0; --num_cells)
    line.remove_prefix(std::min(line.find(','), line.size() - 1) + 1);
  return line;
}

/// The best of the lines that are whole and whose policy was saved. `courses`: the cell of their
/// course set.
double BestOf(std::string_view text, const std::string& courses) {
  const std::size_t num_columns = Split(kHeader, ',').size();
  double best = -1.0;
  for (const std::string_view line : Split(text, '\n')) {
    if (line.empty()) continue;
    std::string_view rest = Behind(line, kCourses);
    if (!rest.starts_with(courses + ",")) continue;
    rest.remove_prefix(courses.size() + 1);
    const auto cells = Split(rest, ',');
    if (cells.size() != num_columns - kCourses - 1 || cells.back() != "1") continue;
    const auto rate = base::ParseNumber<double>(cells[kSuccessRate - kCourses - 1]);
    best = std::max(best, rate.value_or(best));
  }
  return best;
}

base::AppendFile Open(const fs::path& path) {
  base::MakeDirectories(path.parent_path());
  const std::string earlier = base::Exists(path) ? base::ReadTextFile(path) : "";
  if (!earlier.starts_with(kHeader)) {
    if (!earlier.empty()) base::WriteFileAtomically(path.string() + ".before", earlier);
    base::WriteFileAtomically(path, kHeader);
  }
  return {path, base::AppendFile::Mode::kGoOn};
}

}  // namespace

ScoreLog::ScoreLog(const fs::path& path, std::string_view course_set)
    : courses_(CsvField(std::string(course_set))), file_(Open(path)) {
  const std::string earlier = base::ReadFile(path);
  best_before_ = BestOf(earlier, courses_);
  // A loss of power may have torn the last line, and the next must not be glued to it.
  if (earlier.ends_with('\n')) return;
  if (const auto failure = file_.Append("\n")) {
    throw base::Error("{}: {}", path.string(), failure->text);
  }
}

std::optional<base::Failure> ScoreLog::Append(const Figures& set, std::int64_t version,
                                              double seconds, bool kept) {
  const Interval interval = set.success_rate.interval.value_or(Interval{0.0, 1.0});
  return file_.Append(
      fmt::format("{:.0f},{},{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{},{:.4f},{:.2f},{:d}\n",
                  base::UnixSeconds(), version, courses_, set.num_episodes, set.success_rate.value,
                  interval.low, interval.high, set.collision_rate.value, set.timeout_rate.value,
                  set.traversal_time ? fmt::format("{:.2f}", set.traversal_time->value) : "",
                  set.barn_score.value, seconds, kept));
}

}  // namespace slalom::eval
