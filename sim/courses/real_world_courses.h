#pragma once

#include "sim/courses/course.h"

/// Stand-ins for the three places where the paper drove a real robot (Xu et al., sections III-D and
/// IV-E). The plans of those places are not published, so the courses share with them only the
/// facts in the paper. They were laid out by hand and never change. Each has a frame of its own,
/// with the start at the origin facing +x.
///
/// - real-world-1: three rows of cardboard boxes with gaps; 6.0 m straight, 7.35 m of path;
/// - real-world-2: three rooms, two doorways, tables, chairs; 7.58 m straight, 8.56 m of path;
/// - real-world-3: a hall with pillars, boxes and two half walls; 30.0 m straight, 32.40 m of path.
///
/// The lengths suit the paper's times: at no more than 2 m/s, the means of its successful trials
/// are 4.4 to 16.2 s, 6.1 to 35.2 s and 20.5 to 66.9 s. As in those places, nothing moves. A LiDAR
/// 0.2 m above the floor sees the legs of tables and chairs, so the courses hold legs. The
/// reference path keeps 0.32 m from everything, which is more than the corners of the robot (0.46 m
/// x 0.42 m) reach from its centre.

namespace slalom::sim {

inline constexpr int kNumRealWorldCourses = 3;

/// Course "real-world-NUMBER". Requires: 1 <= number <= kNumRealWorldCourses.
Course RealWorldCourse(int number);

}  // namespace slalom::sim
