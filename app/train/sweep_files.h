#pragma once

namespace slalom::train {

/// Names in the directory of a sweep that the live page of a run knows, too. `sweep::CellDirectory`
/// has the others.
inline constexpr char kCellsDirectory[] = "cells";     ///< Holds a directory for each cell.
inline constexpr char kCellRunDirectory[] = "run";     ///< The run, in the directory of its cell.
inline constexpr char kCellFactsFile[] = "cell.json";  ///< Row and seed, beside the run.

}  // namespace slalom::train
