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

/// Keeps a `Table` on disk, in a directory of its own, at the cost of what is new since the last
/// time.
///
/// Each `Save` writes the rows that no earlier one wrote into new segment files, never changed
/// again, and returns a manifest: a short text that names the segments which make up the table. The
/// caller puts it into its checkpoint, and when that is safely on disk calls `Commit` with the
/// manifests of all checkpoints that are still to be loadable. So a crash, a full disk or a kill at
/// any moment costs only the save it interrupted. docs/replay.md gives both formats byte by byte.
///
/// Thread-compatible. One `Storage` per directory at a time.
class Storage {
 public:
  /// Makes the directory where it is missing. Throws `base::Error` where that fails.
  explicit Storage(const std::filesystem::path& directory);

  /// Writes what is new in `table` and returns its manifest. Throws `base::Error` where that fails
  /// (no space, no permission); all earlier manifests are then as good as before, and `Save` may be
  /// tried again. Requires: the table of the `Save`s before, or that which `Load` returned.
  [[nodiscard]] std::string Save(const Table& table);

  /// Deletes the segments, also half-written ones, that none of these manifests names. A file that
  /// cannot be deleted stays.
  void Commit(std::span<const std::string> manifests);

  /// The table as it was at the `Save` that returned `manifest`: the same draws from the same
  /// `Random`. Throws `base::Error` naming the file, `source` for the manifest's, where it or a
  /// segment is missing, cut short or damaged.
  [[nodiscard]] Table Load(std::string_view manifest, std::string_view source = "replay manifest");

  /// A file of rows [begin, end).
  struct Segment {
    std::string name;
    std::int64_t begin = 0;
    std::int64_t end = 0;
    std::uint64_t digest = 0;  ///< Of the checksums of its blocks.
  };

 private:
  Segment WriteSegment(const Table& table, std::int64_t begin, std::int64_t end);
  void ReadSegment(const Segment& segment, std::size_t num_streams, Table* table) const;

  const std::filesystem::path directory_;
  std::vector<Segment> segments_;  ///< Of the last manifest saved or loaded.
  std::int64_t next_index_ = 0;    ///< Of segment names; none is used twice.
};

}  // namespace slalom::replay
