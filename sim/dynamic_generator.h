#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/random.h"
#include "sim/course.h"

/// Generators of courses with moving obstacles like worlds 300 to 499 of the original data set
/// (docs/original-system.md, sections 7.2 and 7.3). The program that made those is not published,
/// so these draw from distributions fitted to what was published; docs/courses.md sets both side by
/// side.
///
/// Courses are functions of (seed, index) alone. Start, goal and frame are those of the static
/// courses. The same bits on every machine.

namespace slalom::sim {

/// An open, walled square in which boxes drive towards the robot.
struct DynamicBoxRecipe {
  int min_boxes = 10;                ///< Number of boxes: uniform from here
  int max_boxes = 14;                ///< to here.
  double min_size = 0.1;             ///< Each side: uniform from here, [m],
  double max_size = 0.5;             ///< to here, [m].
  double min_speed = 0.5;            ///< Mean speed along the way: uniform from here, [m/s],
  double max_speed = 1.5;            ///< to here, [m/s].
  double max_yaw = 0.5 * base::kPi;  ///< Heading: constant, uniform within +- this, [rad].
  int pool_size = 100;  ///< Ways that a hundred courses share; a course has none twice.
};

/// The corridor of the static courses without obstacles, swept by two walls.
struct DynamicWallRecipe {
  double thickness = 0.1;             ///< Across the wall, along x, [m].
  double min_length = 3.5;            ///< Along y: uniform from here, [m],
  double max_length = 4.5;            ///< to here, [m].
  double min_speed = 1.0;             ///< Mean speed: uniform from here, [m/s],
  double max_speed = 1.5;             ///< to here, [m/s].
  double max_yaw = base::kPi / 18.0;  ///< Slant: constant, uniform within +- this, [rad].
};

/// What all courses of a kind share: frame, start, goal, bounds that hold whatever may move in
/// them, and the fixed obstacles. Three walls round 13.5 m x 13.5 m; pen and side walls of the
/// static courses.
Course DynamicBoxArena(std::string name);
Course DynamicWallArena(std::string name);

/// The motion from one pose to another in `period` [s], then a jump back to the first, as all
/// obstacles of the data set move. `size`: of the box along its own x and y, [m].
MovingObstacle StraightLoop(base::Vec2 size, const base::Pose2& from, const base::Pose2& to,
                            double period);

/// A straight way through the square, from y = 14 to y = 0.5, and the time it takes.
struct BoxTrajectory {
  base::Pose2 from;
  base::Pose2 to;
  double period = 0.0;  ///< [s]
};

/// The ways that courses 100 k to 100 k + 99 of a collection share.
std::vector<BoxTrajectory> DrawBoxTrajectories(const DynamicBoxRecipe& recipe,
                                               base::Random& random);

/// One course with boxes on some of `trajectories`. Requires: max_boxes <= trajectories.size().
Course GenerateBoxCourse(std::string name, const DynamicBoxRecipe& recipe,
                         const std::vector<BoxTrajectory>& trajectories, std::uint64_t seed);

/// One course with two walls: the first from right (x = 0) to left, the second the other way.
Course GenerateWallCourse(std::string name, const DynamicWallRecipe& recipe, std::uint64_t seed);

/// Courses [first, first + count) of the collection of `seed`, named "box-SEED-INDEX" and
/// "wall-SEED-INDEX". Requires: first >= 0, count >= 0. Cost: 10 us a course.
CourseSet GenerateBoxCourses(std::uint64_t seed, int first, int count);
CourseSet GenerateWallCourses(std::uint64_t seed, int first, int count);

/// `count` courses named "fresh-box-SEED-INDEX" and "fresh-wall-SEED-INDEX", none of which is in a
/// collection, whatever its seed. Requires: count >= 0.
CourseSet GenerateFreshBoxCourses(std::uint64_t seed, int count);
CourseSet GenerateFreshWallCourses(std::uint64_t seed, int count);

}  // namespace slalom::sim
