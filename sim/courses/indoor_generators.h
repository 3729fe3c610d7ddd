#pragma once

#include <cstdint>
#include <string>

#include "sim/courses/course.h"

/// Halls: large walled floors with clutter of mixed shapes. A course is a function of its seed
/// alone, with the same bits on every machine.

namespace slalom::sim {

/// What floors are drawn from. Every range is drawn uniformly.
struct RoomRecipe {
  double min_side = 8.0;                 ///< Of the floor, along x and along y, [m],
  double max_side = 20.0;                ///< to this, [m].
  double min_room = 2.5;                 ///< Side of a room, at least, [m].
  double corridor_probability = 0.35;    ///< That rooms are parted by a corridor, not by one wall.
  double min_corridor = 1.2;             ///< Width of a corridor, [m],
  double max_corridor = 2.0;             ///< to this, [m].
  double min_door = 0.85;                ///< Width of a door, [m],
  double max_door = 1.3;                 ///< to this, [m].
  double second_door_probability = 0.3;  ///< That a wall has two.
  double max_furniture = 0.3;            ///< Pieces on a square metre of room, from 0, [1/m^2].
  double clearance = 0.35;               ///< From the robot's centre to obstacles on the path, [m].
};

/// Returns a floor on which the robot can drive from one room to another.
///
/// The floor is cut in two across its longer side, by a wall or a corridor, and so are the parts,
/// until they are small; a part that could be cut is left whole with probability 0.15. Each wall
/// has a door, and later walls leave it free. In rooms stand tables (four legs of radius 0.03 m),
/// chairs (legs 0.4 m apart), crates, shelves and bins, none within 0.8 m of a door or 0.6 m of
/// start and goal. The robot faces any way.
///
/// A floor is drawn again unless it has two rooms and a path with `clearance` joins start and goal
/// (`AddReferencePath`). Cost: 4 ms on average.
Course GenerateRoomCourse(std::string name, const RoomRecipe& recipe, std::uint64_t seed);

/// `count` courses named "fresh-rooms-SEED-INDEX". Course i is a function of (seed, i).
/// Requires: count >= 0.
CourseSet GenerateFreshRoomCourses(std::uint64_t seed, int count);

/// What halls are drawn from. Every range is drawn uniformly.
struct HallRecipe {
  double min_side = 20.0;     ///< Of the hall, along x and along y, [m],
  double max_side = 40.0;     ///< to this, [m].
  double min_density = 0.02;  ///< Pieces of clutter on a square metre, [1/m^2],
  double max_density = 0.15;  ///< to this, [1/m^2].
  double min_distance = 5.0;  ///< From start to goal, [m].
  double clearance = 0.35;    ///< From the robot's centre to obstacles along the path, [m].
};

/// Returns a hall that the robot can cross. Start and goal are anywhere, and the robot faces any
/// way.
///
/// Of the pieces, 3 of 10 are pillars (radius 0.1 to 0.5 m), 3 crates (sides of 0.2 to 1.5 m, any
/// heading), 2 benches (1 to 4 m by 0.2 to 0.5 m, any heading), 1 a screen (3 to 8 m by 0.1 m,
/// along a side of the hall) and 1 a table (four legs of radius 0.03 m, 0.5 to 1.5 m apart). A
/// piece that would stand within 0.6 m of start or goal is left out.
///
/// A hall is drawn again unless a path with `clearance` joins start and goal
/// (`AddReferencePath`). Cost: 5 ms on average.
Course GenerateHallCourse(std::string name, const HallRecipe& recipe, std::uint64_t seed);

/// `count` courses named "fresh-halls-SEED-INDEX". Course i is a function of (seed, i).
/// Requires: count >= 0.
CourseSet GenerateFreshHallCourses(std::uint64_t seed, int count);

}  // namespace slalom::sim
