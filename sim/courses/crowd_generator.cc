#include "sim/courses/crowd_generator.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <tuple>
#include <utility>
#include <vector>

#include "base/random.h"
#include "sim/courses/clutter.h"
#include "sim/courses/foresight.h"
#include "sim/courses/numbered_courses.h"

namespace slalom::sim {
namespace {

constexpr double kWallClearance = 0.6;    // From a wall to start and goal, at least, [m].
constexpr double kNearSide = 1.5;         // What is near a side is at most so far inside, [m].
constexpr double kOutside = 1.0;          // Beyond an open side, at most, [m].
constexpr double kMinLeg = 1.0;           // Between the points of a way, [m].
constexpr double kMaxSlant = 0.35;        // [rad]
constexpr double kMotionTimeRange = 1e3;  // Of which motion times are tested, [s].
constexpr int kNumMotionTimes = 4;
constexpr int kNumSides = 4;

/// A field round the origin.
struct Field {
  base::Vec2 half;                          // [m]
  std::array<bool, kNumSides> is_walled{};  // Left, right, below, above.
};

Field DrawField(const CrowdRecipe& recipe, base::Random& random) {
  Field field;
  field.half.x = 0.5 * random.Uniform(recipe.min_side, recipe.max_side);
  field.half.y = 0.5 * random.Uniform(recipe.min_side, recipe.max_side);
  for (bool& is_walled : field.is_walled) is_walled = random.Uniform() < recipe.wall_probability;
  return field;
}

std::vector<Box> WallsOf(const Field& field) {
  const auto [x, y] = field.half;
  std::vector<Box> walls;
  if (field.is_walled[0]) walls.push_back(WallBetween({-x, -y}, {-x, y}));
  if (field.is_walled[1]) walls.push_back(WallBetween({x, -y}, {x, y}));
  if (field.is_walled[2]) walls.push_back(WallBetween({-x, -y}, {x, -y}));
  if (field.is_walled[3]) walls.push_back(WallBetween({-x, y}, {x, y}));
  return walls;
}

base::Vec2 DrawInside(const Field& field, double margin, base::Random& random) {
  const base::Vec2 reach = field.half - base::Vec2{margin, margin};
  const double x = random.Uniform(-reach.x, reach.x);
  const double y = random.Uniform(-reach.y, reach.y);
  return {x, y};
}

/// A point `depth` inside side `side` of the field, anywhere along it.
base::Vec2 DrawAtSide(const Field& field, std::size_t side, double depth, double margin,
                      base::Random& random) {
  const double sign = side % 2 == 0 ? -1.0 : 1.0;
  if (side < 2) {
    return {sign * (field.half.x - depth),
            random.Uniform(margin - field.half.y, field.half.y - margin)};
  }
  return {random.Uniform(margin - field.half.x, field.half.x - margin),
          sign * (field.half.y - depth)};
}

/// Start and goal.
std::pair<base::Vec2, base::Vec2> DrawEnds(const CrowdRecipe& recipe, const Field& field,
                                           base::Random& random) {
  if (random.Uniform() < recipe.across_probability) {
    // Left or right, or below or above: along the longer sides.
    const std::size_t side = random.UniformInt(2) + (field.half.x < field.half.y ? 2 : 0);
    const std::size_t opposite = side ^ 1u;
    const auto end = [&](std::size_t at) {
      const double depth =
          random.Uniform(field.is_walled[at] ? kWallClearance : -kOutside, kNearSide);
      return DrawAtSide(field, at, depth, kWallClearance, random);
    };
    const base::Vec2 start = end(side);
    return {start, end(opposite)};
  }
  while (true) {
    const base::Vec2 start = DrawInside(field, kWallClearance, random);
    const base::Vec2 goal = DrawInside(field, kWallClearance, random);
    if (base::Norm(goal - start) >= recipe.min_distance) return {start, goal};
  }
}

/// Draws points inside until there is one at least `kMinLeg` from all of `others`.
base::Vec2 DrawApart(const Field& field, double margin, const std::vector<base::Vec2>& others,
                     base::Random& random) {
  while (true) {
    const base::Vec2 point = DrawInside(field, margin, random);
    if (others.empty() || base::Norm(point - others.back()) >= kMinLeg) return point;
  }
}

/// The points of an obstacle's way.
std::vector<base::Vec2> DrawWay(const Field& field, double circumradius, Playback& playback,
                                base::Random& random) {
  std::vector<base::Vec2> points;
  const auto add_inside = [&](std::uint64_t count) {
    for (std::uint64_t i = 0; i < count; ++i) {
      points.push_back(DrawApart(field, circumradius, points, random));
    }
  };
  playback = Playback::kLoop;
  switch (random.UniformInt(3)) {
    case 0: {  // Across.
      const double beyond = -(circumradius + kThinWall);
      const std::size_t from = random.UniformInt(kNumSides);
      const std::size_t to = (from + 1 + random.UniformInt(kNumSides - 1)) % kNumSides;
      points.push_back(DrawAtSide(field, from, beyond, circumradius, random));
      add_inside(random.UniformInt(4));
      points.push_back(DrawAtSide(field, to, beyond, circumradius, random));
      break;
    }
    case 1:  // Round.
      add_inside(3 + random.UniformInt(4));
      points.push_back(points.front());
      break;
    default:  // To and fro.
      add_inside(2 + random.UniformInt(3));
      playback = Playback::kPingPong;
  }
  return points;
}

MovingObstacle DrawObstacle(const CrowdRecipe& recipe, const Field& field, double speed,
                            bool is_cylinder, base::Random& random) {
  MovingObstacle obstacle;
  double circumradius = 0.0;
  double yaw = 0.0;
  if (is_cylinder) {
    circumradius = obstacle.radius = random.Uniform(recipe.min_radius, recipe.max_radius);
  } else {
    obstacle.half_size.x = 0.5 * random.Uniform(recipe.min_size, recipe.max_size);
    obstacle.half_size.y = 0.5 * random.Uniform(recipe.min_size, recipe.max_size);
    circumradius = base::Norm(obstacle.half_size);
    yaw = random.Uniform(-base::kPi, base::kPi);
  }
  speed *= random.Uniform(1.0 - recipe.speed_spread, 1.0 + recipe.speed_spread);
  double time = 0.0;
  const std::vector<base::Vec2> points = DrawWay(field, circumradius, obstacle.playback, random);
  for (std::size_t i = 0; i < points.size(); ++i) {
    // Ends at two sides may be near each other at a corner, and so may the ends of a round.
    if (i > 0) time += std::max(kMinLeg, base::Norm(points[i] - points[i - 1])) / speed;
    obstacle.key_frames.push_back({time, {points[i], yaw}});
  }
  return obstacle;
}

/// Whether the disc arrives from each of some motion times. They are drawn as the simulator draws
/// them: again if the start is not clear.
bool CanBeCrossed(const Course& course, base::Random& random) {
  constexpr int kMaxDraws = 5 * kNumMotionTimes;
  const Foresight foresight(course);
  int num_arrivals = 0;
  for (int i = 0; i < kMaxDraws && num_arrivals < kNumMotionTimes; ++i) {
    const double motion_time = random.Uniform(0.0, kMotionTimeRange);
    if (!foresight.IsStartClear(motion_time)) continue;
    if (!foresight.EarliestArrival(motion_time)) return false;
    ++num_arrivals;
  }
  return num_arrivals == kNumMotionTimes;
}

/// A heading. Facing the goal it is within `kMaxSlant` of its direction.
double DrawHeading(base::Vec2 to_goal, bool faces_goal, base::Random& random) {
  const double least = base::SinCos(kMaxSlant).cos * base::Norm(to_goal);
  while (true) {
    const double yaw = random.Uniform(-base::kPi, base::kPi);
    const auto [s, c] = base::SinCos(yaw);
    if (!faces_goal || base::Dot({c, s}, to_goal) >= least) return yaw;
  }
}

void AddObstacles(const CrowdRecipe& recipe, const Field& field, base::Random& random,
                  Course& course) {
  const double area = 4.0 * field.half.x * field.half.y;
  const int most = std::clamp(static_cast<int>(recipe.max_density * area),
                              recipe.least_max_obstacles, recipe.max_obstacles);
  const auto choices = static_cast<std::uint64_t>(most - recipe.min_obstacles) + 1;
  const auto count = static_cast<std::uint64_t>(recipe.min_obstacles) + random.UniformInt(choices);
  const double speed = random.Uniform(recipe.min_speed, recipe.max_speed);
  const std::uint64_t shapes = random.UniformInt(3);  // Cylinders, boxes, both.
  for (std::uint64_t i = 0; i < count; ++i) {
    const bool is_cylinder =
        recipe.only_cylinders || shapes == 0 || (shapes == 2 && random.Uniform() < 0.5);
    course.moving.push_back(DrawObstacle(recipe, field, speed, is_cylinder, random));
  }
}

/// Bounds that hold all that may move in the field, its ends beyond the sides too.
Bounds BoundsOf(const CrowdRecipe& recipe, const Field& field) {
  const double circumradius =
      std::max(recipe.max_radius, base::Norm({0.5 * recipe.max_size, 0.5 * recipe.max_size}));
  const double reach = 2.0 * circumradius + kThinWall;
  const base::Vec2 corner = field.half + base::Vec2{reach, reach};
  return {-1.0 * corner, corner};
}

}  // namespace

Course GenerateCrowdCourse(std::string name, const CrowdRecipe& recipe, std::uint64_t seed) {
  base::Random random(seed);
  while (true) {
    const Field field = DrawField(recipe, random);
    Course course;
    course.bounds = BoundsOf(recipe, field);
    course.boxes = WallsOf(field);
    std::tie(course.start.p, course.goal_W) = DrawEnds(recipe, field, random);
    const bool faces_goal = random.Uniform() < recipe.facing_probability;
    course.start.yaw = DrawHeading(course.goal_W - course.start.p, faces_goal, random);
    AddObstacles(recipe, field, random, course);
    if (!CanBeCrossed(course, random)) continue;
    course.name = std::move(name);
    return course;
  }
}

CourseSet GenerateFreshCrowdCourses(std::uint64_t seed, int count) {
  return MakeNumberedCourses("fresh-crowds", seed, 0, count,
                             [](std::string name, int, std::uint64_t own) {
                               return GenerateCrowdCourse(std::move(name), {}, own);
                             });
}

CourseSet GenerateFreshCylinderCourses(std::uint64_t seed, int count) {
  return MakeNumberedCourses("fresh-cylinders", seed, 0, count,
                             [](std::string name, int, std::uint64_t own) {
                               return GenerateCrowdCourse(std::move(name), kCylinderField, own);
                             });
}

}  // namespace slalom::sim
