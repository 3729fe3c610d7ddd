#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "app/sweep/cell.h"
#include "app/sweep/store.h"

/// Estimates of the time and disk space of cells, from those that are done or from a short trial.

namespace slalom::sweep {

/// Processor time of one worker for the work of cells. A value.
class Rates {
 public:
  /// Learns from a cell's files.
  void Observe(const Cell& cell, const CellStatus& status);
  /// Sets a rate that was measured otherwise: seconds of training for each step in a group.
  void Set(const std::string& group, double seconds_per_step);

  /// The remaining time of a cell, [s], with `steps` and `scores` of it done. Empty if nothing like
  /// it was measured. Unknown times of scores count as 0.
  std::optional<double> SecondsLeft(const Cell& cell, std::int64_t steps, int scores) const;

  bool knows(const std::string& group) const { return training_.contains(group); }
  bool knows_scores() const { return episodes_.count > 0.0; }

 private:
  struct Mean {
    double seconds = 0.0;
    double count = 0.0;
    double value() const { return seconds / count; }
  };
  std::map<std::string, Mean> training_;  ///< By group, over steps.
  Mean all_training_;
  Mean episodes_;
};

/// Trains as the cell would for a few seconds, and returns the time of a step with its updates,
/// [s], or nothing if no update was made in that time. Requires: cell.config. Throws `base::Error`
/// with the end of the training's output if the training cannot be started.
std::optional<double> MeasureSecondsPerStep(const Cell& cell, const std::filesystem::path& program);

/// Duration of work of `work_s` processor seconds, [s], if `at_once` of the `num_cells` remaining
/// cells run at the same time. Requires: at_once >= 1.
double WallSeconds(double work_s, int num_cells, int at_once);

/// Largest disk space of a cell while it trains, [bytes]: replay data and checkpoints.
std::int64_t BytesWhileTraining(const Cell& cell);
/// Approximate disk space of a finished cell, [bytes]: policies, metrics, and tracks of its
/// evaluations.
std::int64_t BytesKept(const Cell& cell);

}  // namespace slalom::sweep
