#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/geometry.h"

/// Maps as ROS's map_server reads them: a description in YAML that names an image.
///
/// Frames: `W` the map's coordinates, `M` its cells, with the origin in the lower left corner.

namespace slalom::sim {

enum class Occupancy : std::uint8_t { kFree, kOccupied, kUnknown };

/// A map of square cells. A value.
struct OccupancyMap {
  int num_x = 0;
  int num_y = 0;
  double resolution = 0.0;  ///< Side of a cell, [m].
  base::Pose2 X_WM;
  std::vector<Occupancy> cells;  ///< [num_y, num_x], from the lower left corner.

  /// Requires: the cell is in the map.
  Occupancy at(int x, int y) const {
    return cells[static_cast<std::size_t>(y) * static_cast<std::size_t>(num_x) +
                 static_cast<std::size_t>(x)];
  }
};

/// The description of a map. A value.
struct MapDescription {
  std::string image;  ///< Path, relative to the description.
  double resolution = 0.0;
  base::Pose2 X_WM;
  bool negate = false;  ///< Bright is occupied, not dark.
  double occupied_threshold = 0.0;
  double free_threshold = 0.0;
  bool is_raw = false;  ///< Mode raw: a pixel is a percentage, above 100 unknown.
};

/// Parses a description. It is a list of the keys image, resolution, origin (x, y, yaw), negate,
/// occupied_thresh, free_thresh and mode, of which only mode may be missing. Throws `Error` that
/// names `source` and line if a key is unknown, repeated or missing, or a value is no good.
MapDescription ParseMapDescription(std::string_view text, std::string_view source);

/// Parses the image of a map, a PGM (P2 or P5). A cell whose occupancy is above the occupied
/// threshold is occupied, one below the free threshold is free, and any other is unknown. Throws
/// `Error` that names `source` if `bytes` are not a whole PGM image, or it is not one for the mode.
OccupancyMap ParseMapImage(const MapDescription& description, std::string_view bytes,
                           std::string_view source);

/// Reads the description in `path` and its image. Throws `Error` as the two above do, or if a file
/// cannot be read.
OccupancyMap ReadMap(const std::filesystem::path& path);

}  // namespace slalom::sim
