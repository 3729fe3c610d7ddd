#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/random.h"
#include "sim/courses/course.h"

/// Generators of courses with moving obstacles like worlds 300 to 499 of the original data set
/// (docs/original-system.md, sections 7.2 and 7.3). The program that made those worlds is not
/// published, so these generators draw from distributions fitted to the published ones;
/// docs/courses.md sets both side by side.
///
/// A course is a function of (seed, index) alone, with the same bits on every machine. Start, goal
/// and frame are the same as in the static courses.

namespace slalom::sim {

/// An open, walled square in which boxes drive towards the robot.
struct DynamicBoxRecipe {
  int min_boxes = 10;                ///< The number of boxes is uniform from this
  int max_boxes = 14;                ///< to this.
  double min_size = 0.1;             ///< Each side is uniform from this, [m],
  double max_size = 0.5;             ///< to this, [m].
  double min_speed = 0.5;            ///< The mean speed is uniform from this, [m/s],
  double max_speed = 1.5;            ///< to this, [m/s].
  double max_yaw = 0.5 * base::kPi;  ///< The heading is constant, uniform within +- this, [rad].
  int pool_size = 100;  ///< Ways that a hundred courses share. No course uses one twice.
};

/// The corridor of the static courses without obstacles, swept by two walls.
struct DynamicWallRecipe {
  double thickness = 0.1;             ///< Across the wall, along x, [m].
  double min_length = 3.5;            ///< The length along y is uniform from this, [m],
  double max_length = 4.5;            ///< to this, [m].
  double min_speed = 1.0;             ///< The mean speed is uniform from this, [m/s],
  double max_speed = 1.5;             ///< to this, [m/s].
  double max_yaw = base::kPi / 18.0;  ///< The slant is constant, uniform within +- this, [rad].
};

/// The parts that all courses of a kind share: frame, start, goal, bounds that hold everything that
/// may move in them, and the fixed obstacles. For boxes these are three walls round 13.5 m x 13.5
/// m; for walls they are the pen and side walls of the static courses.
Course DynamicBoxArena(std::string name);
Course DynamicWallArena(std::string name);

/// A box that moves from one pose to another in `period` [s] and then jumps back to the first, as
/// all obstacles of the data set do. `size` is along the box's own x and y, [m].
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

/// `count` courses named "fresh-box-SEED-INDEX" and "fresh-wall-SEED-INDEX". None of them is in a
/// collection of the functions above, whatever the seeds. Requires: count >= 0.
CourseSet GenerateFreshBoxCourses(std::uint64_t seed, int count);
CourseSet GenerateFreshWallCourses(std::uint64_t seed, int count);

}  // namespace slalom::sim
