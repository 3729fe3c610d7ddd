#include "run/metrics_log.h"

#include <fmt/format.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <sstream>
#include <string>

#include "base/error.h"
#include "base/file.h"
#include "base/progress.h"

namespace slalom::run {
namespace {

constexpr char kHeader[] =
    "training_s,steps,updates,episodes,steps_per_s,updates_per_s,success_rate,collision_rate,"
    "timeout_rate,mean_return,mean_episode_steps,critic_loss,mean_q,actor_q,"
    "critic_gradient_norm,actor_gradient_norm,replay_steps\n";

std::string Cell(double value) { return std::isnan(value) ? "" : fmt::format("{:.6g}", value); }

/// The rows of an earlier metrics file up to a step, and nothing of a half-written last line.
std::string KeptRows(const std::filesystem::path& path, std::int64_t keep_until_step) {
  std::string kept = kHeader;
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

MetricsLog::MetricsLog(const std::filesystem::path& path, std::int64_t keep_until_step)
    : path_(path) {
  base::WriteFileAtomically(path, KeptRows(path, keep_until_step));
  file_.reset(std::fopen(path.c_str(), "a"));
  if (!file_) {
    throw base::Error(fmt::format("{}: cannot open ({})", path.string(), std::strerror(errno)));
  }
}

void MetricsLog::Append(const MetricsRow& row) {
  fmt::print(file_.get(), "{:.2f},{},{},{},{:.0f},{:.1f},{},{},{},{},{},{},{},{},{},{},{}\n",
             row.training_s, row.steps, row.updates, row.episodes, row.steps_per_s,
             row.updates_per_s, Cell(row.success_rate), Cell(row.collision_rate),
             Cell(row.timeout_rate), Cell(row.mean_return), Cell(row.mean_episode_steps),
             Cell(row.critic_loss), Cell(row.mean_q), Cell(row.actor_q),
             Cell(row.critic_gradient_norm), Cell(row.actor_gradient_norm), row.replay_steps);
  if (std::fflush(file_.get()) != 0) {
    throw base::Error(fmt::format("{}: cannot write ({})", path_.string(), std::strerror(errno)));
  }
}

}  // namespace slalom::run
