#pragma once

#include <optional>
#include <string>

#include "sim/course.h"

namespace slalom::sim {

/// Outline of the Jackal that collides (original-system.md §1.1): chassis and wheels.
inline constexpr double kRobotLength = 0.458;  ///< [m]
inline constexpr double kRobotWidth = 0.416;   ///< [m]

/// Why no robot can drive this course: a number that is not one, an outline at the start in an
/// obstacle, a goal that the robot's centre cannot come near, no corridor as wide as the robot
/// between the two inside the bounds. None: nothing stands against it.
///
/// The corridor is sought on a grid of 0.025 m for a disc of the robot's width, so a course that
/// passes may still have a bend too tight for the corners of the outline; one that fails is up to
/// 0.02 m short of a passage for any robot. Cost: about 1 ms for a BARN course.
std::optional<std::string> WhyUnsolvable(const Course& course);

}  // namespace slalom::sim
