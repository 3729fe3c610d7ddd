#pragma once

#include <string>

#include "sim/course.h"

namespace slalom::sim {

/// The course as a picture of characters, y up, for a terminal: '#' obstacle, 'S' start, 'G' goal,
/// 'o' reference path, 'm' moving obstacle at its first key frame, ':' way of its centre, '.' free.
/// A character is 0.15 m wide and 0.30 m high (or more for a wide course, so that no line exceeds
/// 120); it shows an obstacle where any of its area is taken.
std::string DrawText(const Course& course);

/// Facts in lines "name: value": start, goal, obstacles, length of the reference path, difficulty.
std::string DescribeText(const Course& course);

}  // namespace slalom::sim
