#pragma once

#include <cstdint>
#include <string>

#include "sim/courses/course.h"

/// Crowds: cylinders and boxes that move in an otherwise empty field, with a goal at any distance
/// and in any direction. A course is a function of its seed alone, with the same bits on every
/// machine.

namespace slalom::sim {

/// What crowds are drawn from. Every range is drawn uniformly.
struct CrowdRecipe {
  double min_side = 5.0;  ///< Of the field, along x and along y, [m].
  double max_side = 20.0;
  double wall_probability = 0.75;  ///< Of each of the four sides.
  int min_obstacles = 2;
  double max_density = 0.08;    ///< Largest number of obstacles, per square metre of field.
  int least_max_obstacles = 4;  ///< Lower bound of the largest number.
  int max_obstacles = 24;       ///< Upper bound of the largest number.
  double min_radius = 0.1;      ///< Of a cylinder, [m].
  double max_radius = 0.6;
  double min_size = 0.2;  ///< Of each side of a box, [m].
  double max_size = 1.0;
  double min_speed = 0.2;  ///< Mean speed of the obstacles of a course, [m/s].
  double max_speed = 1.9;
  double speed_spread = 0.3;        ///< An obstacle's own mean speed is within this share of it.
  double min_distance = 2.0;        ///< From start to goal, [m].
  double across_probability = 0.5;  ///< That start and goal are near opposite sides.
  double facing_probability = 0.5;  ///< That the robot faces the goal.
  bool only_cylinders = false;      ///< Else a third each of cylinders, boxes and both.
};

/// Fields of 20 m with cylinders of radius 0.5 m and the goal at the other side, in the manner of
/// DynaBARN (Nair et al. 2022).
inline constexpr CrowdRecipe kCylinderField = {.min_side = 20.0,
                                               .max_side = 20.0,
                                               .min_obstacles = 8,
                                               .min_radius = 0.5,
                                               .max_radius = 0.5,
                                               .across_probability = 1.0,
                                               .facing_probability = 1.0,
                                               .only_cylinders = true};

/// Returns a crowd that can be crossed.
///
/// Each obstacle goes one of three ways, at a constant mean speed between its points. Across: from
/// beyond one side of the field to beyond another, through up to 3 points inside, and then again
/// from the beginning. Round: through 3 to 6 points inside and back to the first. To and fro:
/// between 2 to 4 points inside. The heading of a box is constant.
///
/// With `across_probability` start and goal are near the two sides that are farther apart, up to 1
/// m outside an open side; else both are anywhere in the field. With `facing_probability` the robot
/// faces the goal to within 0.35 rad, else it may face any way.
///
/// The straight line to the goal is clear of walls by more than the robot needs. A crowd is drawn
/// again unless a disc that knows all motion arrives from each of four motion times (`Foresight`).
///
/// Cost: 0.7 ms on average.
Course GenerateCrowdCourse(std::string name, const CrowdRecipe& recipe, std::uint64_t seed);

/// `count` courses named "fresh-crowds-SEED-INDEX". Course i is a function of (seed, i).
/// Requires: count >= 0.
CourseSet GenerateFreshCrowdCourses(std::uint64_t seed, int count);

/// The same, named "fresh-cylinders-SEED-INDEX", of `kCylinderField`.
CourseSet GenerateFreshCylinderCourses(std::uint64_t seed, int count);

}  // namespace slalom::sim
