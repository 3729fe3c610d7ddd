#pragma once

#include <filesystem>
#include <optional>

#include "app/sweep/cell.h"

namespace slalom::sweep {

/// Trains as the cell would for a few seconds, and returns the time of a step with its updates,
/// [s], or nothing if no update was made in that time. Requires: cell.config. Throws `base::Error`
/// with the end of the training's output if the training cannot be started.
std::optional<double> MeasureSecondsPerStep(const Cell& cell, const std::filesystem::path& program);

}  // namespace slalom::sweep
