#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

/// What the files of a run tell while it trains and afterwards. Nothing here writes, locks or waits
/// for the run.

namespace slalom::watch {

/// The rows of a metrics.csv by column. A value.
struct MetricsTable {
  std::vector<std::string> names;
  std::vector<std::vector<double>> columns;  ///< One for each name, alike in size. NaN: empty.

  std::size_t num_rows() const { return columns.empty() ? 0 : columns.front().size(); }
  /// The last value of a column; NaN: there is none.
  double Last(std::string_view name) const;
};

/// The table in `text`, however much of it is there: a last line without its end, and lines that do
/// not have a number or nothing in each cell, are left out. `max_rows` > 1: of more rows than this,
/// so many are kept, evenly spread, the last one among them.
MetricsTable ParseMetrics(std::string_view text, std::size_t max_rows);

/// What `slalom watch` says of a config.
struct RunFacts {
  std::int64_t max_steps = 0;                                ///< 0: not known.
  double max_seconds = 0.0;                                  ///< 0: no limit.
  std::vector<std::pair<std::string, std::string>> lines{};  ///< Name and value, in order.
};

enum class RunState {
  kStarting,  ///< No row of metrics.csv yet.
  kTraining,
  kFinished,  ///< Came to one of its limits.
  kStopped,   ///< Nobody trains, and no limit was reached.
};

std::string_view ToString(RunState state);

/// A run as its files show it now. A value.
struct RunProgress {
  std::string name;
  RunState state = RunState::kStarting;
  double age_s = 0.0;  ///< Since metrics.csv was written last, [s].
  /// At the rate so far, [s]; none: not known, or not training.
  std::optional<double> left_s;
  MetricsTable metrics;
};

/// Whether a directory is one of a run: it holds config.toml or metrics.csv.
bool IsRun(const std::filesystem::path& directory);

/// The run in `directory`. None: it is no longer there. `max_rows`: as in `ParseMetrics`.
std::optional<RunProgress> ReadRun(const std::filesystem::path& directory, const RunFacts& facts,
                                   std::size_t max_rows);

/// The runs to watch: `root` itself where it is one, else those directly in it, by name.
std::vector<std::filesystem::path> ListRuns(const std::filesystem::path& root);

/// The directory's name in lists and addresses.
std::string NameOf(const std::filesystem::path& run);

}  // namespace slalom::watch
