#include "sim/courses/dynamic_generator.h"

#include <cstddef>
#include <utility>

#include "base/check.h"
#include "sim/courses/barn_field.h"
#include "sim/courses/numbered_courses.h"

namespace slalom::sim {
namespace {

// The square of the box courses, [m].
constexpr double kLeft = -9.0;
constexpr double kRight = 4.5;
constexpr double kBack = 0.5;    // Behind the robot, where the boxes' ways end.
constexpr double kFront = 14.0;  // Open; where they begin.
constexpr double kWallThickness = 0.1;

// The corridor of the wall courses, [m].
constexpr double kCorridorLeft = -4.5;
constexpr double kCorridorRight = 0.0;
constexpr double kWallsMiddle = 7.25;

constexpr int kCoursesPerPool = 100;

base::Pose2 DrawEnd(double y, double yaw, base::Random& random) {
  return {{random.Uniform(kLeft, kRight), y}, yaw};
}

CourseSet BoxCourses(const std::string& stream, std::uint64_t seed, int first, int count) {
  const DynamicBoxRecipe recipe;
  std::vector<BoxTrajectory> pool;
  return MakeNumberedCourses(
      stream, seed, first, count, [&](std::string name, int i, std::uint64_t own) {
        if (i == first || i % kCoursesPerPool == 0) {
          base::Random random(base::DeriveSeed(seed, stream + "-pool",
                                               {static_cast<std::uint64_t>(i / kCoursesPerPool)}));
          pool = DrawBoxTrajectories(recipe, random);
        }
        return GenerateBoxCourse(std::move(name), recipe, pool, own);
      });
}

CourseSet WallCourses(const std::string& stream, std::uint64_t seed, int first, int count) {
  return MakeNumberedCourses(stream, seed, first, count,
                             [](std::string name, int, std::uint64_t own) {
                               return GenerateWallCourse(std::move(name), {}, own);
                             });
}

}  // namespace

Course DynamicBoxArena(std::string name) {
  Course course;
  course.name = std::move(name);
  course.start = BarnStart();
  course.goal_W = BarnGoal();
  // The bounds reach 0.4 m beyond the ends, more than a box of 0.5 m reaches from its centre.
  course.bounds = {{-9.4, 0.1}, {4.9, 14.4}};
  const base::Vec2 half_size = {0.5 * kWallThickness, 0.5 * (kFront - kBack)};
  const base::Vec2 middle = {0.5 * (kLeft + kRight), 0.5 * (kBack + kFront)};
  course.boxes = {{{{middle.x, kBack}, 0.5 * base::kPi}, half_size},
                  {{{kLeft, middle.y}, 0.0}, half_size},
                  {{{kRight, middle.y}, 0.0}, half_size}};
  return course;
}

Course DynamicWallArena(std::string name) {
  // A wall at either side, slanted by 10 degrees, still reaches 0.45 m beyond.
  constexpr double kReach = 0.5;
  FieldGrid side_walls;
  side_walls.set_row(0, FieldGrid::kFullRow);
  side_walls.set_row(kFieldSize - 1, FieldGrid::kFullRow);
  Course course = MakeBarnCourse(std::move(name), side_walls, {});
  course.bounds.min_W.x -= kReach;
  course.bounds.max_W.x += kReach;
  return course;
}

MovingObstacle StraightLoop(base::Vec2 size, const base::Pose2& from, const base::Pose2& to,
                            double period) {
  return {.radius = 0.0,
          .half_size = 0.5 * size,
          .key_frames = {{0.0, from}, {period, to}},
          .playback = Playback::kLoop};
}

std::vector<BoxTrajectory> DrawBoxTrajectories(const DynamicBoxRecipe& recipe,
                                               base::Random& random) {
  std::vector<BoxTrajectory> trajectories;
  for (int i = 0; i < recipe.pool_size; ++i) {
    const double yaw = random.Uniform(-recipe.max_yaw, recipe.max_yaw);
    const base::Pose2 from = DrawEnd(kFront, yaw, random);
    const base::Pose2 to = DrawEnd(kBack, yaw, random);
    const double speed = random.Uniform(recipe.min_speed, recipe.max_speed);
    trajectories.push_back({from, to, base::Norm(to.p - from.p) / speed});
  }
  return trajectories;
}

Course GenerateBoxCourse(std::string name, const DynamicBoxRecipe& recipe,
                         const std::vector<BoxTrajectory>& trajectories, std::uint64_t seed) {
  SLALOM_CHECK_LE(static_cast<std::size_t>(recipe.max_boxes), trajectories.size());
  base::Random random(seed);
  Course course = DynamicBoxArena(std::move(name));
  const auto choices = static_cast<std::uint64_t>(recipe.max_boxes - recipe.min_boxes) + 1;
  const auto num_boxes = static_cast<std::size_t>(recipe.min_boxes) + random.UniformInt(choices);
  // Takes the first of a shuffle (Fisher and Yates), so that none is drawn twice.
  std::vector<std::size_t> order(trajectories.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  for (std::size_t i = 0; i < num_boxes; ++i) {
    std::swap(order[i], order[i + random.UniformInt(order.size() - i)]);
    const BoxTrajectory& way = trajectories[order[i]];
    const double size_x = random.Uniform(recipe.min_size, recipe.max_size);
    const double size_y = random.Uniform(recipe.min_size, recipe.max_size);
    course.moving.push_back(StraightLoop({size_x, size_y}, way.from, way.to, way.period));
  }
  return course;
}

Course GenerateWallCourse(std::string name, const DynamicWallRecipe& recipe, std::uint64_t seed) {
  base::Random random(seed);
  Course course = DynamicWallArena(std::move(name));
  for (const bool from_right : {true, false}) {
    const double from = from_right ? kCorridorRight : kCorridorLeft;
    const double to = from_right ? kCorridorLeft : kCorridorRight;
    const double length = random.Uniform(recipe.min_length, recipe.max_length);
    const double yaw = random.Uniform(-recipe.max_yaw, recipe.max_yaw);
    const double speed = random.Uniform(recipe.min_speed, recipe.max_speed);
    course.moving.push_back(StraightLoop({recipe.thickness, length}, {{from, kWallsMiddle}, yaw},
                                         {{to, kWallsMiddle}, yaw},
                                         (kCorridorRight - kCorridorLeft) / speed));
  }
  return course;
}

CourseSet GenerateBoxCourses(std::uint64_t seed, int first, int count) {
  return BoxCourses("box", seed, first, count);
}

CourseSet GenerateWallCourses(std::uint64_t seed, int first, int count) {
  return WallCourses("wall", seed, first, count);
}

CourseSet GenerateFreshBoxCourses(std::uint64_t seed, int count) {
  return BoxCourses("fresh-box", seed, 0, count);
}

CourseSet GenerateFreshWallCourses(std::uint64_t seed, int count) {
  return WallCourses("fresh-wall", seed, 0, count);
}

}  // namespace slalom::sim
