#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/sweep/cell.h"

/// Results of finished cells without their policies, to be committed or taken to another store. An
/// archive is a directory with one directory for each cell, as a store's `cells/` has:
///
///     DIR/ID/cell.json, trained.json, scored.json   as in the store
///     DIR/ID/training.toml, scores/DIGEST.toml      the keys that are not at their defaults
///     DIR/ID/scores/DIGEST/evaluation.json          `eval::CompactResult`
///     DIR/ID/run/metrics.csv                        if snapshots are scored: steps and seconds
///
/// No file there names a path of the machine that made it.

namespace slalom::sweep {

/// Counts of the cells by what happened to them.
struct Copied {
  int num_new = 0;   ///< Cells that got files.
  int num_same = 0;  ///< Cells that were there, with the same results.
  int num_busy = 0;  ///< Cells that a worker has, which are left alone.
  int num_left = 0;  ///< Cells that are not done, or not of the plan.
};

/// Writes the results of all cells that are done into an archive. Throws `base::Error` before it
/// writes anything if a file is damaged, or if the archive has other results for a cell; the error
/// names both files. No file is overwritten.
Copied ExportCells(const std::filesystem::path& store, const std::vector<Cell>& cells,
                   const std::filesystem::path& archive);

/// Copies the cells of an archive into a store, where they then count as done. A cell that the
/// store has with its policy is left alone. If `cells` is given, copies only these. Throws like
/// `ExportCells`, and if there is no such archive.
Copied ImportCells(const std::filesystem::path& archive, const std::filesystem::path& store,
                   const std::optional<std::vector<Cell>>& cells = std::nullopt);

}  // namespace slalom::sweep
