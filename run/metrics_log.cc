#include "run/metrics_log.h"

#include <fmt/format.h>

#include <cmath>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "base/log.h"
#include "base/progress.h"

namespace slalom::run {
namespace {

struct Column {
  std::string_view name;
  std::string text;    // Its cell; empty: not known.
  std::string tag;     // In the event file.
  double value = 0.0;  // NaN: not known.
};

/// Every column, in the file's order.
std::vector<Column> Columns(const MetricsRow& row) {
  std::vector<Column> columns;
  const auto add = [&columns](std::string_view name, auto value, const char* format = "{}") {
    const auto number = static_cast<double>(value);
    columns.push_back({name, std::isnan(number) ? "" : fmt::format(fmt::runtime(format), value),
                       fmt::format("training/{}", name), number});
  };
  const char* const kFigure = "{:.6g}";
  add("training_s", row.training_s, "{:.2f}");
  add("steps", row.steps);
  add("updates", row.updates);
  add("episodes", row.episodes);
  add("steps_per_s", row.steps_per_s, "{:.0f}");
  add("updates_per_s", row.updates_per_s, "{:.1f}");
  add("success_rate", row.success_rate, kFigure);
  add("collision_rate", row.collision_rate, kFigure);
  add("timeout_rate", row.timeout_rate, kFigure);
  add("mean_return", row.mean_return, kFigure);
  add("mean_episode_steps", row.mean_episode_steps, kFigure);
  add("critic_loss", row.critic_loss, kFigure);
  add("mean_q", row.mean_q, kFigure);
  add("actor_q", row.actor_q, kFigure);
  add("critic_gradient_norm", row.critic_gradient_norm, kFigure);
  add("actor_gradient_norm", row.actor_gradient_norm, kFigure);
  add("replay_steps", row.replay_steps);
  add("entropy", row.entropy, kFigure);
  add("temperature", row.temperature, kFigure);
  add("cost_q", row.cost_q, kFigure);
  add("multiplier", row.multiplier, kFigure);
  add("violation", row.violation, kFigure);
  add("model_loss", row.model_loss, kFigure);
  add("model_error", row.model_error, kFigure);
  add("model_change", row.model_change, kFigure);
  add("model_likelihood", row.model_likelihood, kFigure);
  add("model_reward_error", row.model_reward_error, kFigure);
  add("model_termination", row.model_termination, kFigure);
  add("model_inside_50", row.model_inside_50, kFigure);
  add("model_inside_90", row.model_inside_90, kFigure);
  add("model_steps_error", row.model_steps_error, kFigure);
  return columns;
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

/// The rows of an earlier metrics file up to a step, and nothing of a half-written last line.
std::string KeptRows(const std::filesystem::path& path, std::int64_t keep_until_step) {
  std::string kept = Line(Columns({}), true);
  if (keep_until_step <= 0 || !std::filesystem::exists(path)) return kept;
  std::istringstream lines(base::ReadFile(path));
  std::string line;
  while (std::getline(lines, line)) {
    const auto comma = line.find(',');
    if (comma == std::string::npos || lines.eof()) continue;
    char* end = nullptr;
    const long long steps = std::strtoll(line.c_str() + comma + 1, &end, 10);
    if (*end == ',' && steps > 0 && steps <= keep_until_step) kept += line + "\n";
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
                     remaining_s < 0 ? "?" : base::FormatDuration(remaining_s));
}

MetricsLog::MetricsLog(const std::filesystem::path& path, std::int64_t keep_until_step) {
  base::WriteFileAtomically(path, KeptRows(path, keep_until_step));
  file_.emplace(path, base::AppendFile::Mode::kGoOn);
  events_.emplace(path.parent_path(), keep_until_step + 1);
}

void MetricsLog::Append(const MetricsRow& row) {
  const std::vector<Column> columns = Columns(row);
  std::vector<proto::Scalar> scalars;
  scalars.reserve(columns.size());
  for (const Column& column : columns) scalars.push_back({column.tag, column.value});
  auto failure = file_->Append(Line(columns, false));
  if (!failure) failure = events_->Append(row.steps, scalars);
  if (failure && !failing_) spdlog::error("{}; rows are left out until it can", failure->text);
  failing_ = failure.has_value();
}

}  // namespace slalom::run
