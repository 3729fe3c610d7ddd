#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "app/sweep/cell.h"
#include "app/sweep/plan.h"
#include "app/sweep/store.h"
#include "metrics/registry.h"

namespace slalom::sweep {

/// The label `method` of a cell: the algorithm and the parts that it is combined with, joined by
/// '-' (td3, td3-lagrangian, td3-dyna, sac-mbpo, td3-mpc), or the planner.
std::string MethodName(const Cell& cell);

/// The encoder, with its history if that is more than one frame ("gru-h4"); "none" for a planner.
std::string NetworkName(const Cell& cell);

/// The metrics of a sweep (docs/metrics.md, "Sweeps"), read from its cells' files alone, so that
/// the workers may be on any machine. Every reading replaces the one before, so cells that have
/// gone leave no series behind.
///
/// Thread-compatible; its registry is thread-safe, so an `Exposer` may show it meanwhile.
class SweepMetrics {
 public:
  /// Time between two readings by `Update`.
  static constexpr std::chrono::seconds kInterval{5};

  /// Reads once. `identity` need not have a role and run: these are "sweep" and the plan's name.
  SweepMetrics(const Plan& plan, Cells cells, std::filesystem::path store,
               metrics::Identity identity = {});

  /// Reads the files if the last reading is `kInterval` old. Call it as often as convenient.
  void Update(std::chrono::steady_clock::time_point now = std::chrono::steady_clock::now());

  /// Reads the files. Files that are being written or are damaged count as not there.
  /// Cost: a few small files for each cell; an evaluation is read again only after it has changed.
  void Read();

  const metrics::Registry& registry() const { return registry_; }

 private:
  /// The figures of an evaluation that are shown.
  struct Score {
    double success_rate = 0.0;
    double collision_rate = 0.0;
  };
  struct CachedScore {
    std::filesystem::file_time_type written;
    std::optional<Score> score;  ///< Empty if the file is damaged.
  };

  std::optional<Score> ReadScore(const std::filesystem::path& file);
  /// Adds the series of one cell.
  void AddCell(const Cell& cell, const CellStatus& status, std::vector<metrics::Sample>& samples);

  const std::string name_;
  const Cells cells_;
  const std::filesystem::path store_;
  metrics::Registry registry_;
  std::map<std::filesystem::path, CachedScore> scores_;
  std::chrono::steady_clock::time_point last_reading_;
};

}  // namespace slalom::sweep
