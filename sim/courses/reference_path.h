#pragma once

#include <vector>

#include "sim/courses/course.h"

namespace slalom::sim {

/// Finds a reference path for a course that has none: the corners of the way from start to goal,
/// both left out, as `Course::reference_path_W` has them. Empty if the robot can drive the straight
/// line, or if no path was found.
///
/// The path is that of the generator (`FindPath`), on cells of 0.15 m of which one is centred at
/// the start. Where a disc of the robot's width does not fit through on these cells, they are
/// halved, twice at most and only if there are then at most 1.2e6 cells. Moving obstacles do not
/// count.
///
/// Requires: !WhyUnsolvable(course). Cost: milliseconds for a course of 10 m x 10 m; grows with the
/// area.
std::vector<base::Vec2> FindReferencePath(const Course& course);

/// Gives a course its reference path and its difficulty, or returns false if no path keeps
/// `clearance` [m] from the robot's centre to fixed obstacles on cells of 0.15 m. The path is empty
/// if the straight line keeps it; the difficulty is measured along the cells even so.
///
/// Requires: no fixed obstacle is nearer than `clearance` to start or goal, both are inside the
/// bounds. Cost: some milliseconds for 30 m x 30 m.
bool AddReferencePath(Course& course, double clearance);

}  // namespace slalom::sim
