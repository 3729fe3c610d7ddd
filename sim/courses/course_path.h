#pragma once

#include <optional>
#include <vector>

#include "sim/courses/barn_field.h"

namespace slalom::sim {

/// Finds the cheapest way from `entry` to `exit`, both included, over cells that are not `blocked`.
/// Returns nothing if there is none.
///
/// A move goes to one of the 8 neighbours, turns by at most 45 degrees and does not pass between
/// two blocked cells that touch at a corner. It costs its length in cells, and 5 / d more if it
/// ends at a distance of d <= 2 cells from a blocked one. The search is exact over (cell, direction
/// of arrival); the published A* keeps one direction per cell.
///
/// Requires: both ends are in the field and not blocked.
std::optional<std::vector<Cell>> FindPath(const FieldGrid& blocked, Cell entry, Cell exit);

}  // namespace slalom::sim
