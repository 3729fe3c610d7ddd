#pragma once

#include <filesystem>
#include <string>

#include "sweep/cell.h"
#include "sweep/plan.h"

namespace slalom::cli {

/// Where `slalom sweep serve` shows metrics unless told otherwise.
inline constexpr char kSweepMetricsAddress[] = "127.0.0.1:9420";

/// Shows the metrics of a sweep (`sweep::SweepMetrics`) at `address`, as `metrics::Exposer` takes
/// it, until SIGINT, SIGTERM or SIGHUP. Prints where. Works on no cell and writes nothing, so it
/// may run beside any number of workers, or before the store is there. Returns the exit code.
/// Throws `base::Error` if the address cannot be listened on.
int ServeSweep(const sweep::Plan& plan, const sweep::Cells& cells,
               const std::filesystem::path& store, const std::string& address);

}  // namespace slalom::cli
