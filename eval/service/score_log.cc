#include "eval/service/score_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <utility>
#include <vector>

#include "base/clock.h"
#include "base/file.h"

namespace slalom::eval {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kHeader =
    "unix_s,policy_version,courses,episodes,success_rate,success_low,success_high,collision_rate,"
    "timeout_rate,traversal_time_s,barn_score,evaluation_s\n";
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

/// The best of the lines that are whole.
double BestOf(std::string_view text, std::string_view course_set) {
  const std::size_t num_columns = Split(kHeader, ',').size();
  double best = -1.0;
  for (const std::string_view line : Split(text, '\n')) {
    const auto cells = Split(line, ',');
    if (cells.size() != num_columns || cells[kCourses] != course_set) continue;
    double rate = 0.0;
    const std::string_view cell = cells[kSuccessRate];
    if (std::from_chars(cell.begin(), cell.end(), rate).ec == std::errc()) {
      best = std::max(best, rate);
    }
  }
  return best;
}

base::AppendFile Open(const fs::path& path) {
  base::MakeDirectories(path.parent_path());
  if (!fs::exists(path)) base::WriteFileAtomically(path, kHeader);
  return {path, base::AppendFile::Mode::kGoOn};
}

}  // namespace

ScoreLog::ScoreLog(const fs::path& path, std::string course_set)
    : course_set_(std::move(course_set)),
      best_before_(fs::exists(path) ? BestOf(base::ReadFile(path), course_set_) : -1.0),
      file_(Open(path)) {}

std::optional<base::Failure> ScoreLog::Append(const Figures& set, std::int64_t version,
                                              double seconds) {
  const Interval interval = set.success_rate.interval.value_or(Interval{0.0, 1.0});
  return file_.Append(fmt::format(
      "{:.0f},{},{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{},{:.4f},{:.2f}\n", base::UnixSeconds(),
      version, course_set_, set.num_episodes, set.success_rate.value, interval.low, interval.high,
      set.collision_rate.value, set.timeout_rate.value,
      set.traversal_time ? fmt::format("{:.2f}", set.traversal_time->value) : "",
      set.barn_score.value, seconds));
}

}  // namespace slalom::eval
