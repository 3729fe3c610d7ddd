#pragma once

#include <span>
#include <vector>

#include "sim/barn_field.h"

/// How hard a course is, by the five measures of Perille et al. 2020, "Benchmarking Metric Ground
/// Navigation" (docs/original-system.md, section 7.1), unit 1 cell of 0.15 m.

namespace slalom::sim {

/// Each measure averaged over the cells of `path`, in the free space of the robot.
///
/// - distance to obstacle: from the cell to the nearest blocked cell;
/// - visibility: mean number of free cells, the cell itself included, along those of 8 rays that
/// end at a
///   blocked cell inside the field (0 where none does);
/// - dispersion: changes between "ends at a blocked cell within 3 cells" and "does not" round 16
/// rays;
/// - characteristic dimension: the shortest free width of 4 axes through the cell, between the
/// centres of
///   the outermost free cells;
/// - tortuosity: length of the path over the distance between its ends.
///
/// The published code rounds visibility down to whole cells (Python 2 division); this does not.
/// Requires: path.size() >= 2, first cell != last cell, every cell in the field.
Difficulty MeasureDifficulty(const FieldGrid& blocked, std::span<const Cell> path);

/// One course's measures less their mean over `all`, over their standard deviation there:
/// comparable with one another, and 0 for the average course. A measure that is the same in all
/// courses becomes 0. Requires: !all.empty().
Difficulty Normalise(const Difficulty& difficulty, std::span<const Difficulty> all);

}  // namespace slalom::sim
