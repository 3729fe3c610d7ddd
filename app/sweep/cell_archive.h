#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/sweep/cell.h"

/// Results of finished cells without their policies, to be committed or taken to another store. An
/// archive is a file of JSON lines, compressed by `xz`. The first one has the keys `format`
/// ("slalom-cells") and `version` (2). Each one after it is a cell, with the keys `id` and `files`,
/// ordered by `id`. `files` has these files of the cell's directory in a store by their paths, JSON
/// as it is and anything else as a string:
///
///     cell.json, trained.json, scored.json   as in the store
///     training.toml, scores/DIGEST.toml      the keys that are not at their defaults
///     scores/DIGEST/evaluation.json          `eval::CompactResult`
///     run/metrics.csv                        if snapshots are scored: steps and seconds
///
/// No path of the machine that made it is among them.

namespace slalom::sweep {

/// The text in the format of `xz`, with a checksum. The same text gives the same bytes.
std::string CompressXz(std::string_view text);

/// The text that `CompressXz` was given. Throws `base::Error` that names `source` if the bytes are
/// not whole, or if the text is larger than 1 GiB.
std::string DecompressXz(std::string_view bytes, const std::string& source);

/// Counts of the cells by result of the copy.
struct Copied {
  int num_new = 0;   ///< Cells that got files.
  int num_same = 0;  ///< Cells that were there, with the same results.
  int num_busy = 0;  ///< Cells that a worker has, which are left alone.
  int num_left = 0;  ///< Cells that are not done, or not of the plan.
};

/// Writes the results of all cells that are done into an archive. Throws `base::Error` before it
/// writes anything if a file is damaged, or if the archive has other results for a cell; the error
/// names both. Results that are there stay.
Copied ExportCells(const std::filesystem::path& store, const std::vector<Cell>& cells,
                   const std::filesystem::path& archive);

/// Copies the cells of an archive into a store, where they then count as done. Leaves a cell alone
/// if the store has it with its policy. If `cells` is given, copies only these. Throws like
/// `ExportCells`, and if there is no such archive.
Copied ImportCells(const std::filesystem::path& archive, const std::filesystem::path& store,
                   const std::optional<std::vector<Cell>>& cells = std::nullopt);

}  // namespace slalom::sweep
