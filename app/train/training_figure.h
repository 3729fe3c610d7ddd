#pragma once

#include <string>

namespace slalom::train {

/// A run's course as an SVG picture (docs/operations.md, training.svg): success, collisions and
/// timeouts of the training episodes, their return, and the scores of snapshots on the test
/// courses, over training time with the steps beside it. `metrics` and `curve` are the texts of
/// metrics.csv and curve.csv; the second may be empty. A cell that is empty and a column that is
/// missing
/// leave a gap; lines that are not whole are left out (`run::ParseMetrics`).
std::string DrawTrainingFigure(const std::string& run_name, const std::string& metrics,
                               const std::string& curve);

}  // namespace slalom::train
