#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "replay/table.h"

namespace slalom::replay {

/// Saves a `Table` incrementally to a directory of its own.
///
/// Each `Save` writes the rows that no earlier one wrote to new part files, which never change
/// again. It returns a manifest: a short text that names the part files of the table. The caller
/// stores the manifest in its checkpoint and, once that is safely on disk, calls `Commit` with the
/// manifests of all checkpoints that must remain loadable. So a crash, a full disk or a kill at any
/// moment loses only the interrupted save. docs/replay.md specifies both formats byte by byte.
///
/// Thread-compatible. One `Storage` per directory at a time.
class Storage {
 public:
  /// Creates the directory if it is missing. Throws `base::Error` if that fails.
  explicit Storage(const std::filesystem::path& directory);

  /// Writes the new rows of `table` and returns its manifest. Throws `base::Error` if that fails
  /// (no space, no permission). It then leaves no file, all earlier manifests remain valid, and
  /// `Save` may be tried again.
  /// Requires: `table` is the one of earlier `Save`s, or the one that `Load` returned.
  [[nodiscard]] std::string Save(const Table& table);

  /// Deletes all part files, also incomplete ones, that none of these manifests names. A file that
  /// cannot be deleted stays. Throws `base::Error`, and deletes nothing, if there is no manifest
  /// (`DeleteAll` is for that) or one of them is damaged.
  void Commit(std::span<const std::string> manifests);

  /// Deletes the directory, for runs that keep no checkpoint. Files that cannot be deleted stay. No
  /// `Save` may follow.
  void DeleteAll();

  /// Returns the table as it was at the `Save` that returned `manifest`; the same `Random` then
  /// gives the same draws. Throws `base::Error` if the manifest or a part file is missing, cut
  /// short or damaged. The message names the file, and the manifest by `source`.
  [[nodiscard]] Table Load(std::string_view manifest, std::string_view source = "replay manifest");

  /// The approximate size of part files that hold `num_rows` rows: headers of files do not count.
  static std::int64_t BytesOfRows(const env::StepShape& shape, std::int64_t num_rows);
  /// The most rows in a part file. A part file is deleted once its last row is overwritten, so this
  /// bounds the disk space of rows that are overwritten already.
  static constexpr std::int64_t kPartFileRows = 32768;

  /// A file with the rows [begin, end).
  struct PartFile {
    std::string name;
    std::int64_t begin = 0;
    std::int64_t end = 0;
    std::uint64_t digest = 0;  ///< Checksum of the checksums of its blocks.
  };

 private:
  PartFile WritePartFile(const Table& table, std::int64_t begin, std::int64_t end);
  void ReadPartFile(const PartFile& part, std::size_t num_streams, Table* table) const;

  const std::filesystem::path directory_;
  std::vector<PartFile> part_files_;  ///< Part files of the last manifest saved or loaded.
  std::int64_t next_index_ = 0;       ///< Index of the next part file; none is used twice.
};

}  // namespace slalom::replay
