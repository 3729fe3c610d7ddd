#pragma once

#include <cstdint>
#include <string>

#include "sim/courses/course.h"

/// Halls: large walled floors with clutter of mixed shapes. A course is a function of its seed
/// alone, with the same bits on every machine.

namespace slalom::sim {

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
