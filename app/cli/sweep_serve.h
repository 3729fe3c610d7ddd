#pragma once

#include <filesystem>
#include <string>
#include <thread>

#include "app/sweep/cell.h"
#include "app/sweep/plan.h"
#include "app/sweep/sweep_metrics.h"
#include "metrics/exposer.h"

namespace slalom::cli {

/// Default address at which `slalom sweep serve` shows metrics.
inline constexpr char kSweepMetricsAddress[] = "127.0.0.1:9420";

/// Shows the metrics of a sweep (`sweep::SweepMetrics`) for as long as it exists, and keeps them up
/// to date in a thread of its own. Works on no cell and writes nothing, so any number of them may
/// show the same sweep, even before its store exists.
class SweepExposer {
 public:
  /// `address`: as for `metrics::Exposer`, with its errors. Prints the address of the metrics.
  SweepExposer(const sweep::Plan& plan, const sweep::Cells& cells,
               const std::filesystem::path& store, const std::string& address);

 private:
  sweep::SweepMetrics metrics_;
  const metrics::Exposer exposer_;
  std::jthread thread_;
};

/// Shows the metrics until SIGINT, SIGTERM or SIGHUP. Returns the exit code. Throws `base::Error`
/// if the address cannot be listened on.
int ServeSweep(const sweep::Plan& plan, const sweep::Cells& cells,
               const std::filesystem::path& store, const std::string& address);

}  // namespace slalom::cli
