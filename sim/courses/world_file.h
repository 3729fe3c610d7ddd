#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "sim/courses/course.h"

namespace slalom::sim {

/// The obstacles of a Gazebo world. A value.
struct World {
  std::vector<Circle> circles;  ///< Fixed vertical cylinders, in the order of the file.
  std::vector<Box> boxes;       ///< Fixed upright boxes, likewise.
  int num_moving_models = 0;  ///< Models that a plugin drives; the file does not say how they move.
  bool has_damaged_end = false;  ///< The end of the file was mended, see `ParseWorld`.
};

/// Parses a world in SDF (XML). Planes are taken for the ground and left out; heights are ignored.
///
/// A damaged end is mended and reported in `has_damaged_end`: a missing last '>', or stray text
/// after "</sdf>". Worlds 300 to 399 of the original end in `</sdf>"`, which strict parsers refuse.
/// Throws `Error` that names `source` if the text is damaged elsewhere or holds things that a
/// course cannot: another shape, a tilted shape, or a model that is neither static nor driven by a
/// plugin.
World ParseWorld(std::string_view text, std::string_view source);

/// Reads a .world file. Throws `Error` as `ParseWorld` does, or if the file cannot be read.
World ReadWorld(const std::filesystem::path& path);

}  // namespace slalom::sim
