#pragma once

#include <string>

#include "sim/courses/course.h"

namespace slalom::sim {

/// Draws the course in characters, y up, for a terminal: '#' obstacle, 'S' start, 'G' goal, 'o'
/// reference path, 'm' moving obstacle at its first key frame, ':' way of its centre, '.' free. A
/// character stands for 0.15 m x 0.30 m, or more if the course is so wide that lines would exceed
/// 120 characters. It shows an obstacle if an obstacle takes any part of that area.
std::string DrawText(const Course& course);

/// Describes the course in lines "name: value": the characters of `DrawText`, start, goal,
/// obstacles, length of the reference path, difficulty.
std::string DescribeText(const Course& course);

}  // namespace slalom::sim
