#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "sim/courses/course.h"

namespace slalom::sim {

/// Outline of the Jackal that collides (docs/original-system.md, section 1.1): chassis and wheels.
inline constexpr double kRobotLength = 0.458;  ///< [m]
inline constexpr double kRobotWidth = 0.416;   ///< [m]

/// An obstacle that moves or turns faster than this between two key frames is taken for a mistake.
inline constexpr double kMaxObstacleSpeed = 100.0;  ///< [m/s], and [rad/s]

/// Checks `obstacle.key_frames[i]` against the key frame before it. Returns the reason why it
/// cannot follow, or nothing if it can. Reasons are a value that is not a finite number, a first
/// time other than 0, a time that is not later, and a speed above `kMaxObstacleSpeed`.
/// Requires: i < obstacle.key_frames.size().
std::optional<std::string> WhyBadKeyFrame(const MovingObstacle& obstacle, std::size_t i);

/// Checks whether a robot can drive this course. Returns the reason why none can, or nothing if one
/// may. Reasons are a value that is not a finite number, a size that is not positive, bad key
/// frames (`WhyBadKeyFrame`), a start at which the robot's outline overlaps a fixed obstacle, a
/// goal that the robot's centre cannot reach, and no corridor as wide as the robot that joins the
/// two inside the bounds.
///
/// Moving obstacles come and go, so they do not count for the corridor. It is sought on a grid of
/// 0.025 m for a disc of the robot's width. A course that passes may therefore still have a bend
/// too tight for the corners of the outline, and a course that fails may have a passage that is up
/// to 0.02 m wider than the robot. Cost: about 1 ms for a BARN course.
std::optional<std::string> WhyUnsolvable(const Course& course);

/// Returns warnings, one sentence each, about things that are allowed but may be mistakes: moving
/// obstacles that drive over a robot waiting at the start, and moving obstacles that stand still.
/// Obstacles are numbered from 0. Requires: !WhyUnsolvable(course). Cost: about 0.1 ms for each
/// moving obstacle.
std::vector<std::string> CourseWarnings(const Course& course);

}  // namespace slalom::sim
