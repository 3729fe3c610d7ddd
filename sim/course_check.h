#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "sim/course.h"

namespace slalom::sim {

/// Outline of the Jackal that collides (docs/original-system.md, section 1.1): chassis and wheels.
inline constexpr double kRobotLength = 0.458;  ///< [m]
inline constexpr double kRobotWidth = 0.416;   ///< [m]

/// An obstacle that moves or turns faster between two key frames is taken for a mistake.
inline constexpr double kMaxObstacleSpeed = 100.0;  ///< [m/s], and [rad/s]

/// Why `obstacle.key_frames[i]` cannot follow the one before it: a number that is not one, a first
/// time other than 0, a time that is not later, a way too long for the time (`kMaxObstacleSpeed`).
/// Requires: i < obstacle.key_frames.size().
std::optional<std::string> WhyBadKeyFrame(const MovingObstacle& obstacle, std::size_t i);

/// Why no robot can drive this course: a number that is not one, a size that is not above 0, key
/// frames that are none (`WhyBadKeyFrame`), an outline at the start in a fixed obstacle, a goal
/// that the robot's centre cannot come near, no corridor as wide as the robot between the two
/// inside the bounds. None: nothing stands against it.
///
/// Moving obstacles come and go, so whether they leave a way open is not asked. The corridor is
/// sought on a grid of 0.025 m for a disc of the robot's width, so a course that passes may still
/// have a bend too tight for the corners of the outline; one that fails is up to 0.02 m short of a
/// passage for any robot. Cost: about 1 ms for a BARN course.
std::optional<std::string> WhyUnsolvable(const Course& course);

/// What is allowed but may surprise, one sentence each: moving obstacles that drive over a robot
/// waiting at the start, and such that stand still, each by its number from 0. Requires:
/// !WhyUnsolvable(course). Cost: about 0.1 ms for a moving obstacle.
std::vector<std::string> CourseWarnings(const Course& course);

}  // namespace slalom::sim
