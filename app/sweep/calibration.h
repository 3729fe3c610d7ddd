#pragma once

#include <filesystem>
#include <optional>

#include "app/sweep/cell.h"

namespace slalom::sweep {

/// Trains as the cell would for a few seconds, and returns how long a step with its updates took,
/// [s]. None: it made no update in that time. Requires: cell.config. Throws `base::Error` if the
/// training cannot be started, with the end of what it printed.
std::optional<double> MeasureSecondsPerStep(const Cell& cell, const std::filesystem::path& program);

}  // namespace slalom::sweep
