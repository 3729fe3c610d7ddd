#include "sim/courses/hall_generator.h"

#include <algorithm>
#include <utility>

#include "base/random.h"
#include "sim/courses/clutter.h"
#include "sim/courses/numbered_courses.h"
#include "sim/courses/reference_path.h"

namespace slalom::sim {
namespace {

constexpr double kEndMargin = 0.8;  // From the walls to start and goal, [m].
constexpr double kEndSpace = 0.6;   // From clutter to start and goal, [m].

/// A box whose sides are drawn from these ranges.
Piece DrawBox(const base::Pose2& X_WB, base::Vec2 x_range, base::Vec2 y_range,
              base::Random& random) {
  const double x = random.Uniform(x_range.x, x_range.y);
  const double y = random.Uniform(y_range.x, y_range.y);
  return {{}, {{X_WB, {0.5 * x, 0.5 * y}}}};
}

Piece DrawPiece(const Bounds& hall, base::Random& random) {
  base::Pose2 X_WB = DrawPose(hall, 0.0, random);
  switch (random.UniformInt(10)) {
    case 0:
    case 1:
    case 2:
      return {{{X_WB.p, random.Uniform(0.1, 0.5)}}, {}};
    case 3:
    case 4:
    case 5:
      return DrawBox(X_WB, {0.2, 1.5}, {0.2, 1.5}, random);
    case 6:
    case 7:
      return DrawBox(X_WB, {1.0, 4.0}, {0.2, 0.5}, random);
    case 8:
      X_WB.yaw = random.Uniform() < 0.5 ? 0.0 : 0.5 * base::kPi;
      return DrawBox(X_WB, {3.0, 8.0}, {kThinWall, kThinWall}, random);
    default: {
      const double x = random.Uniform(0.25, 0.75);
      const double y = random.Uniform(0.25, 0.75);
      return LegsAt(DrawPose(hall, 1.1, random), {x, y}, 0.03);  // All legs are inside.
    }
  }
}

Course DrawHall(const HallRecipe& recipe, base::Random& random) {
  Course course;
  const double width = random.Uniform(recipe.min_side, recipe.max_side);
  const double depth = random.Uniform(recipe.min_side, recipe.max_side);
  const Bounds hall{{-0.5 * width, -0.5 * depth}, {0.5 * width, 0.5 * depth}};
  Enclose(hall, course);
  do {
    course.start = DrawPose(hall, kEndMargin, random);
    course.goal_W = DrawPose(hall, kEndMargin, random).p;
  } while (base::Norm(course.goal_W - course.start.p) < recipe.min_distance);
  const double density = random.Uniform(recipe.min_density, recipe.max_density);
  const int num_pieces = static_cast<int>(density * width * depth);
  for (int i = 0; i < num_pieces; ++i) {
    const Piece piece = DrawPiece(hall, random);
    if (DistanceToEnds(piece, course) >= kEndSpace) Add(piece, course);
  }
  return course;
}

}  // namespace

Course GenerateHallCourse(std::string name, const HallRecipe& recipe, std::uint64_t seed) {
  base::Random random(seed);
  while (true) {
    Course course = DrawHall(recipe, random);
    if (!AddReferencePath(course, recipe.clearance)) continue;
    course.name = std::move(name);
    return course;
  }
}

CourseSet GenerateFreshHallCourses(std::uint64_t seed, int count) {
  return MakeNumberedCourses("fresh-halls", seed, 0, count,
                             [](std::string name, int, std::uint64_t own) {
                               return GenerateHallCourse(std::move(name), {}, own);
                             });
}

}  // namespace slalom::sim
