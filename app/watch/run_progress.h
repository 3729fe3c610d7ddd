#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "learner/run/metrics_table.h"

/// Reads the state of a run from its files, while it trains and afterwards. Nothing here writes,
/// locks or waits for the run.

namespace slalom::watch {

/// A training that comes before the run itself (app/train/resolved_run.h).
struct StageFacts {
  std::string name;
  std::filesystem::path directory;
};

/// The facts about a run's config that `slalom watch` shows.
struct RunFacts {
  std::int64_t max_steps = 0;                                ///< 0 if not known.
  double max_seconds = 0.0;                                  ///< 0 for no limit.
  std::vector<StageFacts> stages{};                          ///< In the order of training.
  std::vector<std::pair<std::string, std::string>> lines{};  ///< Name and value, in order.
  /// Keys of the config that are not at their defaults, and their values as TOML.
  std::vector<std::pair<std::string, std::string>> changes{};
};

enum class RunState {
  kStarting,  ///< No row of metrics.csv yet.
  kTraining,
  kFinished,  ///< Reached one of its limits.
  kStopped,   ///< No process trains it, and no limit was reached.
};

std::string_view ToString(RunState state);

/// A run as its files show it now. A value.
struct RunProgress {
  std::string name;
  RunState state = RunState::kStarting;
  /// The stage that was trained last, "walls (2 of 3)", whose figures the others are. Empty once
  /// the run itself has begun, or if it has no stages.
  std::string stage;
  double age_s = 0.0;  ///< Time since metrics.csv was written last, [s].
  /// Time left at the rate so far, [s]; empty if not known, or not training.
  std::optional<double> left_s;
  run::MetricsTable metrics;
  run::MetricsTable scores;  ///< Content of curve.csv; empty: not scored.
};

/// Returns whether a directory is a run's: it holds config.toml or metrics.csv.
bool IsRun(const std::filesystem::path& directory);

/// Points of a curve that a page shows; more cannot be seen.
inline constexpr std::size_t kMaxPoints = 600;

/// Reads the run in `directory`. Returns nothing if it no longer exists. `max_rows`: as in
/// `run::ParseMetrics`.
std::optional<RunProgress> ReadRun(const std::filesystem::path& directory, const RunFacts& facts,
                                   std::size_t max_rows);

/// Returns the runs to watch: `root` itself if it is a run, else the runs directly in it, and the
/// runs of a sweep's cells if it is the directory of sweeps or cells (app/sweep/store.h), by path.
std::vector<std::filesystem::path> ListRuns(const std::filesystem::path& root);

/// Returns the name of a run in lists and addresses: its directory's, or for the cell of a sweep
/// its row, seed and id.
std::string NameOf(const std::filesystem::path& run);

}  // namespace slalom::watch
