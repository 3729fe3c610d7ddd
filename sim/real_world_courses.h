#pragma once

#include "sim/course.h"

/// Stand-ins for the three places where the paper drove a real robot (its section on physical
/// experiments). They have in common with them what the paper says of these, no more; the places
/// themselves are not published. Laid out by hand, fixed for good, in a frame of their own: start
/// at the origin facing +x.
///
/// - real-world-1: three rows of cardboard boxes with gaps; 6.0 m straight, 7.35 m of path;
/// - real-world-2: three rooms, two doorways, tables, chairs; 7.58 m straight, 8.56 m of path;
/// - real-world-3: a hall with pillars, boxes and two half walls; 30.0 m straight, 32.40 m of path.
///
/// The lengths suit the paper's times: its means of successful trials are 4.4 to 16.2 s, 6.1 to
/// 35.2 s and 20.5 to 66.9 s, with at most 2 m/s. Everything stands still, as there. A LiDAR 0.2 m
/// above the floor sees the legs of tables and chairs, so those are what stands here. The reference
/// path keeps 0.32 m from everything, more than the corners of the robot (0.46 m x 0.42 m) reach
/// from its centre.

namespace slalom::sim {

inline constexpr int kNumRealWorldCourses = 3;

/// Course "real-world-NUMBER". Requires: 1 <= number <= kNumRealWorldCourses.
Course RealWorldCourse(int number);

}  // namespace slalom::sim
