#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "sim/courses/course.h"

namespace slalom::sim {

/// The obstacles of a Gazebo world. A value.
struct World {
  std::vector<Circle> circles;          ///< Fixed vertical cylinders, in the order of the file.
  std::vector<Box> boxes;               ///< Fixed upright boxes, likewise.
  std::vector<int> moving_model_lines;  ///< Line of each model that a plugin drives. The file does
                                        ///< not say how it moves.
  int num_out_of_reach = 0;      ///< Shapes that a robot drives over or under, which are left out.
  bool has_damaged_end = false;  ///< The end of the file was mended, see `ParseWorld`.
};

/// Parses a world in SDF (XML), version 1. The ground is level and at height 0.
///
/// Reads the models of the world itself, their links and collisions, and their poses. Poses in a
/// <state>, which Gazebo writes if it saves a world, take the place of the models' own. Passes over
/// what has no effect on obstacles: the ground, lights, visuals, physics and the like. Every
/// element and attribute of a world, model, link, collision, pose or shape is either one of these,
/// or it is refused by name and line. docs/courses.md lists them.
///
/// A shape must reach from below to above the LiDAR, 0.2 m above the ground. Shapes that end at
/// most 0.02 m above the ground or begin at least 0.5 m above it are left out.
///
/// A damaged end is mended and reported in `has_damaged_end`: a missing last '>', or stray text
/// after "</sdf>". Worlds 300 to 399 of the original end in `</sdf>"`, which strict parsers refuse.
/// Throws `Error` that names `source` and the line if the text is damaged elsewhere or holds things
/// that a course cannot: another shape, a tilted shape, a shape that a robot hits without seeing
/// it, a model that is included from elsewhere, or one that is neither static nor driven by a
/// plugin.
World ParseWorld(std::string_view text, std::string_view source);

/// Reads a .world file. Throws `Error` as `ParseWorld` does, or if the file cannot be read.
World ReadWorld(const std::filesystem::path& path);

}  // namespace slalom::sim
