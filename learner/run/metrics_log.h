#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>

#include "base/append_file.h"
#include "learner/run/event_file.h"
#include "metrics/learning_figures.h"

namespace slalom::run {

/// One row of `metrics.csv`, which the progress line shows, too. Rates are over the time since the
/// last row; statistics of episodes are over the actor's most recent episodes. NaN stands for a
/// value that is not known yet (an empty cell). `Visit` lists the columns in their order: name,
/// value, meaning and format. Without a format, whole numbers are written in full and others with
/// six digits.
struct MetricsRow {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  double training_s = 0.0;
  std::int64_t steps = 0;
  std::int64_t updates = 0;
  std::int64_t episodes = 0;
  double steps_per_s = 0.0;
  double updates_per_s = 0.0;
  double success_rate = 0.0;
  double collision_rate = 0.0;
  double timeout_rate = 0.0;
  double episode_return = 0.0;
  double episode_steps = 0.0;
  double courses = kNone;
  double fresh_success = kNone;
  double learnable_share = kNone;
  std::int64_t table_steps = 0;
  metrics::LearningFigures learning;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("training_s", training_s, "Time spent training (`TrainingClock`), over all sessions.",
      "{:.2f}");
    v("steps", steps, "Environment steps.");
    v("updates", updates, "Updates.");
    v("episodes", episodes, "Training episodes that ended.");
    v("steps_per_s", steps_per_s, "Environment steps a second.", "{:.0f}");
    v("updates_per_s", updates_per_s, "Updates a second.", "{:.1f}");
    v("success_rate", success_rate, "Share of episodes that reached the goal.");
    v("collision_rate", collision_rate, "Share of episodes that collided.");
    v("timeout_rate", timeout_rate, "Share of episodes that ran out of time.");
    v("episode_return", episode_return, "Mean return of an episode.");
    v("episode_steps", episode_steps, "Mean steps of an episode.");
    v("courses", courses, "Different courses driven in training.", "{:.0f}");
    v("fresh_success", fresh_success, "Mean success on the fresh courses measured last.");
    v("learnable_share", learnable_share,
      "Share of the fresh courses measured last with both successes and failures.");
    v("table_steps", table_steps, "Environment steps in the replay table.");
    learning.Visit(v);
  }
};

/// Returns the row as a progress line. `remaining_s`: time left, [s]; NaN if not known.
std::string FormatProgress(const MetricsRow& row, double remaining_s);

/// Appends rows to `metrics.csv`, each written at once, so that a killed run keeps its rows, and to
/// a TensorBoard event file beside it (`EventFile`): every column as a scalar
/// "training/COLUMN". Confined to one thread.
class MetricsLog {
 public:
  /// Opens or makes the file. Rows after `keep_until_step` are dropped first: a resumed run writes
  /// them again, and its event file supersedes them. Throws `base::Error` if a file cannot be
  /// written.
  MetricsLog(const std::filesystem::path& path, std::int64_t keep_until_step);

  /// Appends a row. A row that cannot be written is left out as a whole, and the first of several
  /// is logged: a full disk does not end the training.
  void Append(const MetricsRow& row);

 private:
  std::optional<base::AppendFile> file_;
  std::optional<EventFile> events_;
  bool failing_ = false;
};

}  // namespace slalom::run
