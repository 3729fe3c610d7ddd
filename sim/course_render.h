#pragma once

#include <span>
#include <string>

#include "sim/course.h"
#include "sim/episode_file.h"

namespace slalom::sim {

enum class PictureFormat { kSvg, kPng };

/// A course and what was driven on it.
struct CourseScene {
  const Course* course = nullptr;
  std::span<const EpisodeTrack> tracks;  ///< Drawn as they are; none: the course alone.
};

/// The picture of one course from above, y up: fixed obstacles, moving ones (where they begin,
/// their outline each second, their way), start with the robot's outline, goal with the circle in
/// which it counts as reached, reference path, tracks coloured by outcome with the outline now and
/// then and at the end, a legend and a scale bar. 64 pixels to a metre, or fewer where the course
/// is larger than 31 m. Returns the bytes of the file. Requires: scene.course. Throws `Error` where
/// the bounds make a picture too large.
std::string RenderCourse(const CourseScene& scene, PictureFormat format);

/// Several courses in a grid, row by row, with one legend. The bytes of the file.
/// Requires: !scenes.empty(), num_columns >= 1. Throws `Error` where the picture would be too
/// large.
std::string RenderContactSheet(std::span<const CourseScene> scenes, int num_columns,
                               PictureFormat format);

}  // namespace slalom::sim
