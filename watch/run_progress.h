#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

<<<<<<< HEAD
#include "run/metrics_table.h"

    /// What the files of a run tell while it trains and afterwards. Nothing here writes, locks or
    /// waits for the run.

    namespace slalom::watch {

  /// What `slalom watch` says of a config.
=======
  /// Reads the state of a run from its files, while it trains and afterwards. Nothing here writes,
  /// locks or waits for the run.

  namespace slalom::watch {

  /// The rows of a metrics.csv by column. A value.
  struct MetricsTable {
    std::vector<std::string> names;
    std::vector<std::vector<double>> columns;  ///< One for each name, alike in size. NaN: empty.

    std::size_t num_rows() const { return columns.empty() ? 0 : columns.front().size(); }
    /// Returns the last value of a column; NaN: there is none.
    double Last(std::string_view name) const;
  };

  /// Parses the table in `text`, of which the end may be missing. A last line without a line end is
  /// left out, and so is a line with a cell that is neither a number nor empty. `max_rows` > 1: if
  /// there are more rows, this many are kept, evenly spread, the last one among them.
  MetricsTable ParseMetrics(std::string_view text, std::size_t max_rows);

  /// What `slalom watch` shows of a run's config.
>>>>>>> h-words
  struct RunFacts {
    std::int64_t max_steps = 0;                                ///< 0: not known.
    double max_seconds = 0.0;                                  ///< 0: no limit.
    std::vector<std::pair<std::string, std::string>> lines{};  ///< Name and value, in order.
  };

  enum class RunState {
    kStarting,  ///< No row of metrics.csv yet.
    kTraining,
    kFinished,  ///< Came to one of its limits.
    kStopped,   ///< No process trains it, and no limit was reached.
  };

  std::string_view ToString(RunState state);

  /// A run as its files show it now. A value.
  struct RunProgress {
    std::string name;
    RunState state = RunState::kStarting;
    double age_s = 0.0;  ///< Since metrics.csv was written last, [s].
    /// Time left at the rate so far, [s]; none: not known, or not training.
    std::optional<double> left_s;
    run::MetricsTable metrics;
  };

  /// Returns whether a directory is that of a run: it holds config.toml or metrics.csv.
  bool IsRun(const std::filesystem::path& directory);

<<<<<<< HEAD
  /// The run in `directory`. None: it is no longer there. `max_rows`: as in `run::ParseMetrics`.
=======
  /// Reads the run in `directory`. Returns nothing if it no longer exists. `max_rows`: as in
  /// `ParseMetrics`.
>>>>>>> h-words
  std::optional<RunProgress> ReadRun(const std::filesystem::path& directory, const RunFacts& facts,
                                     std::size_t max_rows);

  /// Returns the runs to watch: `root` itself if it is a run, else those directly in it, by name.
  std::vector<std::filesystem::path> ListRuns(const std::filesystem::path& root);

  /// Returns the name of a run in lists and addresses.
  std::string NameOf(const std::filesystem::path& run);

  }  // namespace slalom::watch
