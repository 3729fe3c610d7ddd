#pragma once

#include <span>

#include "sim/courses/barn_field.h"
#include "sim/courses/course.h"
#include "sim/courses/course_path.h"

/// How hard a course is: by the five measures of Perille et al. 2020, "Benchmarking Metric Ground
/// Navigation" (docs/original-system.md, section 7.1), whose unit of length is a cell of 0.15 m,
/// and by what moves.

namespace slalom::sim {

/// Averages each measure over the cells of `path`, in the free space of the robot.
///
/// - Distance to obstacle: the distance from the cell to the nearest blocked cell.
/// - Visibility: 8 rays leave the cell. The measure is the mean number of free cells, the cell
///   itself included, along the rays that end at a blocked cell inside the field, or 0 if none
///   does.
/// - Dispersion: going round 16 rays, the number of changes between rays that meet a blocked cell
///   within 3 cells and rays that do not.
/// - Characteristic dimension: the shortest free width along 4 axes through the cell, measured
///   between the centres of the outermost free cells.
/// - Tortuosity: the length of the path divided by the distance between its ends.
///
/// The published code rounds visibility down to whole cells (Python 2 division); this function does
/// not.
/// Requires: path.size() >= 2, first cell != last cell, every cell in the field.
Difficulty MeasureDifficulty(const PathGrid& blocked, std::span<const Cell> path);
Difficulty MeasureDifficulty(const FieldGrid& blocked, std::span<const Cell> path);

/// Normalises a course's measures: subtracts their mean over `all` and divides by their standard
/// deviation there, so that measures can be compared with one another. An average course has 0, and
/// so does a measure that is the same in all courses. Requires: !all.empty().
Difficulty Normalise(const Difficulty& difficulty, std::span<const Difficulty> all);

/// How much moves on a course.
struct MotionMeasures {
  double density = 0.0;     ///< Moving obstacles on a square metre within the bounds, [1/m^2].
  double mean_speed = 0.0;  ///< Mean of the obstacles' mean speeds between key frames, [m/s].
};

/// Both are 0 if nothing moves.
MotionMeasures MeasureMotion(const Course& course);

}  // namespace slalom::sim
