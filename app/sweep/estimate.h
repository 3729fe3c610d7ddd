#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>

#include "app/sweep/cell.h"
#include "app/sweep/store.h"

/// How long cells take and how much they write, from those that are done.

namespace slalom::sweep {

/// What a cell takes, in processor time of one worker. A value.
class Rates {
 public:
  /// Learns from a cell's files.
  void Observe(const Cell& cell, const CellStatus& status);
  /// Learns what was measured otherwise: seconds of training for each step in a group.
  void Set(const std::string& group, double seconds_per_step);

  /// The time that is left of a cell, [s]: `steps` and `scores` of it are done. None: nothing like
  /// it was measured. What is not known about scores counts as 0.
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

/// How long work of `work_s` processor seconds takes where `at_once` of the `num_cells` cells that
/// are left run at the same time, [s]. Requires: at_once >= 1.
double WallSeconds(double work_s, int num_cells, int at_once);

/// The most that a cell has on disk while it trains, [bytes]: replay data and checkpoints.
std::int64_t BytesWhileTraining(const Cell& cell);
/// About what stays of it, [bytes]: policies, metrics, and tracks of its evaluations.
std::int64_t BytesKept(const Cell& cell);

}  // namespace slalom::sweep
