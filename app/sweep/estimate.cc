#include "app/sweep/estimate.h"

#include <algorithm>

#include "app/train/disk_room.h"

namespace slalom::sweep {
namespace {

// Measured on runs of configs/fast: what a course of an evaluation leaves (track, rows, picture),
// and a run without its checkpoints.
constexpr std::int64_t kBytesPerScoredCourse = 20'000;
constexpr std::int64_t kBytesPerRun = 3'000'000;

}  // namespace

void Rates::Observe(const Cell& cell, const CellStatus& status) {
  if (cell.config && status.trained && status.trained->steps > 0) {
    const auto steps = static_cast<double>(status.trained->steps);
    for (Mean* mean : {&training_[cell.group], &all_training_}) {
      mean->seconds += status.trained->training_s;
      mean->count += steps;
    }
  }
  if (status.scored && status.scored->episodes > 0) {
    episodes_.seconds += status.scored->wall_s;
    episodes_.count += static_cast<double>(status.scored->episodes);
  }
}

void Rates::Set(const std::string& group, double seconds_per_step) {
  training_[group] = {seconds_per_step, 1.0};
}

std::optional<double> Rates::SecondsLeft(const Cell& cell, std::int64_t steps, int scores) const {
  double seconds = 0.0;
  if (cell.config && steps < cell.config->run.max_steps) {
    if (cell.config->run.max_seconds > 0.0) {
      seconds += cell.config->run.max_seconds;
    } else {
      const auto group = training_.find(cell.group);
      const Mean& mean = group == training_.end() ? all_training_ : group->second;
      if (mean.count == 0.0) return std::nullopt;
      seconds += mean.value() * static_cast<double>(cell.config->run.max_steps - steps);
    }
  }
  if (episodes_.count > 0.0) {
    for (std::size_t i = static_cast<std::size_t>(scores); i < cell.scores.size(); ++i) {
      seconds += episodes_.value() * static_cast<double>(cell.scores[i].num_episodes);
    }
  }
  return seconds;
}

double WallSeconds(double work_s, int num_cells, int at_once) {
  return work_s / std::clamp(num_cells, 1, at_once);
}

std::int64_t BytesWhileTraining(const Cell& cell) {
  if (!cell.config) return 0;
  return train::CheckpointReplayBytes(*cell.config).most + kBytesPerRun;
}

std::int64_t BytesKept(const Cell& cell) {
  std::int64_t bytes = cell.config ? kBytesPerRun : 0;
  for (const ScoreTask& task : cell.scores) bytes += kBytesPerScoredCourse * task.num_courses;
  return bytes;
}

}  // namespace slalom::sweep
