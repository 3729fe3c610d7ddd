#pragma once

#include <span>
#include <string>

#include "sim/courses/course.h"
#include "sim/courses/episode_file.h"

namespace slalom::sim {

enum class PictureFormat { kSvg, kPng };

/// A course and the drives on it.
struct CourseScene {
  const Course* course = nullptr;
  std::span<const EpisodeTrack> tracks;  ///< Drawn as they are; may be empty.
};

/// Draws one course from above, y up, and returns the bytes of the picture's file.
///
/// The picture shows the fixed obstacles; the moving ones where they begin, with their outline at
/// each second and their way; the start with the robot's outline; the goal with the circle in which
/// it counts as reached; the reference path; the tracks, coloured by outcome, with the robot's
/// outline now and then and at the end, and rings where a guard changed the action; a legend and a
/// scale bar. It has 64 pixels to a metre, or
/// fewer if the course is larger than 31 m.
///
/// Requires: scene.course is not null. Throws `Error` if the picture would be too large.
std::string RenderCourse(const CourseScene& scene, PictureFormat format);

/// Draws several courses in a grid, row by row, with one legend, and returns the bytes of the
/// picture's file. Requires: !scenes.empty(), num_columns >= 1. Throws `Error` if the picture would
/// be too large.
std::string RenderContactSheet(std::span<const CourseScene> scenes, int num_columns,
                               PictureFormat format);

}  // namespace slalom::sim
