#pragma once

#include <optional>
#include <vector>

#include "sim/barn_field.h"

namespace slalom::sim {

/// The cheapest way from `entry` to `exit` over cells that are not `blocked`, both ends included: 8
/// moves, turns of at most 45 degrees, none between two blocked cells that touch at a corner. A
/// move costs its length in cells, and 5 / d more where it ends within d <= 2 cells of a blocked
/// one.
///
/// Exact over (cell, direction of arrival), where the published A* keeps one direction per cell.
/// None: there is no such way.
/// Requires: both ends in the field and not blocked.
std::optional<std::vector<Cell>> FindPath(const FieldGrid& blocked, Cell entry, Cell exit);

}  // namespace slalom::sim
