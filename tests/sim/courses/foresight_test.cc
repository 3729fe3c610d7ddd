#include "sim/courses/foresight.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "base/random.h"
#include "sim/courses/crowd_generator.h"
#include "sim/courses/motion.h"

namespace slalom::sim {
namespace {

constexpr double kCell = 0.2;  // [m]

Course Empty(base::Vec2 goal_W) {
  Course course;
  course.name = "empty";
  course.goal_W = goal_W;
  course.bounds = {{-1.0, -2.05}, {6.0, 2.05}};
  return course;
}

/// Distance from a point to the nearest obstacle at this motion time.
double ClearanceAt(const Course& course, base::Vec2 p_W, double motion_time) {
  double nearest = 1e9;
  for (const Circle& circle : course.circles) nearest = std::min(nearest, DistanceTo(circle, p_W));
  for (const Box& box : course.boxes) nearest = std::min(nearest, DistanceTo(box, p_W));
  for (const MovingObstacle& obstacle : course.moving) {
    const base::Pose2 X_WB = Motion(obstacle).At(motion_time).X_WB;
    nearest =
        std::min(nearest, obstacle.radius > 0.0 ? DistanceTo(Circle{X_WB.p, obstacle.radius}, p_W)
                                                : DistanceTo(Box{X_WB, obstacle.half_size}, p_W));
  }
  return nearest;
}

/// The same search written down plainly: a set of places, each tested by its distance.
std::optional<double> PlainArrival(const Course& course, double motion_time,
                                   const ForesightConfig& config) {
  using Place = std::pair<int, int>;
  const auto point = [&](Place at) {
    return course.start.p + kCell * base::Vec2{double(at.first), double(at.second)};
  };
  const auto is_inside = [&](base::Vec2 p) {
    return p.x >= course.bounds.min_W.x && p.x <= course.bounds.max_W.x &&
           p.y >= course.bounds.min_W.y && p.y <= course.bounds.max_W.y;
  };
  const base::Vec2 to_goal = (1.0 / kCell) * (course.goal_W - course.start.p);
  const Place goal = {static_cast<int>(std::lround(to_goal.x)),
                      static_cast<int>(std::lround(to_goal.y))};
  const double step = kCell / config.speed;
  std::set<Place> reached = {{0, 0}};
  for (int i = 0; i * step <= config.limit; ++i) {
    if (reached.contains(goal)) return i * step;
    std::set<Place> next;
    for (const auto& [x, y] : reached) {
      for (const Place& to : {Place{x, y}, {x - 1, y}, {x + 1, y}, {x, y - 1}, {x, y + 1}}) {
        if (next.contains(to) || !is_inside(point(to))) continue;
        if (ClearanceAt(course, point(to), motion_time + (i + 1) * step) > config.radius) {
          next.insert(to);
        }
      }
    }
    reached = std::move(next);
  }
  return std::nullopt;
}

TEST(Foresight, AnEmptyFieldTakesTheWayAlongBothAxes) {
  const Course course = Empty({3.0, 1.0});  // 15 and 5 cells.
  EXPECT_DOUBLE_EQ(*Foresight(course).EarliestArrival(7.0), 20 * kCell / 1.5);
  EXPECT_DOUBLE_EQ(*Foresight(course, {.speed = 2.0}).EarliestArrival(7.0), 20 * kCell / 2.0);
  EXPECT_FALSE(Foresight(course, {.limit = 2.6}).EarliestArrival(7.0));
  EXPECT_TRUE(Foresight(course, {.limit = 2.7}).EarliestArrival(7.0));
}

TEST(Foresight, AWallWithAGapIsPassedIfTheDiscFits) {
  Course course = Empty({3.0, 0.0});
  // From y = -2.05 to 0.2 and from 1.2 to 2.05: the gap is 1 m wide.
  course.boxes = {{{{1.5, -0.925}, 0.0}, {0.05, 1.125}}, {{{1.5, 1.625}, 0.0}, {0.05, 0.425}}};
  // Through the middle of the gap, at y = 0.8 or 0.6: 15 + 2 * 3 cells at least.
  EXPECT_DOUBLE_EQ(*Foresight(course).EarliestArrival(0.0), 21 * kCell / 1.5);
  EXPECT_FALSE(Foresight(course, {.radius = 0.55}).EarliestArrival(0.0));
}

TEST(Foresight, ADoorThatOpensIsWaitedFor) {
  Course course = Empty({3.0, 0.0});
  // A wall across the field until 10 s, though the spline moves it a little; then it goes away.
  MovingObstacle door;
  door.half_size = {0.05, 3.0};
  door.key_frames = {
      {0.0, {{1.5, 0.0}, 0.0}}, {10.0, {{1.5, 0.0}, 0.0}}, {12.0, {{1.5, 9.0}, 0.0}}};
  course.moving = {door};
  const Foresight foresight(course);
  const double from_five = *foresight.EarliestArrival(5.0);
  EXPECT_GT(from_five, 5.0);
  EXPECT_LT(from_five, 8.0);
  EXPECT_NEAR(*foresight.EarliestArrival(7.0), from_five - 2.0, 2 * kCell / 1.5);
  EXPECT_TRUE(foresight.IsStartClear(5.0));
  course.start.p = {1.2, 0.0};
  EXPECT_FALSE(Foresight(course).IsStartClear(5.0));
}

TEST(Foresight, CrowdsAreSearchedLikeWrittenDownPlainly) {
  CrowdRecipe recipe;
  recipe.max_side = 9.0;
  recipe.max_density = 0.2;
  const ForesightConfig config{.limit = 8.0};
  base::Random random(4);
  int num_arrivals = 0;
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const Course course = GenerateCrowdCourse("crowd", recipe, seed);
    const double motion_time = random.Uniform(0.0, 1000.0);
    const auto expected = PlainArrival(course, motion_time, config);
    EXPECT_EQ(Foresight(course, config).EarliestArrival(motion_time), expected) << seed;
    EXPECT_EQ(Foresight(course, config).IsStartClear(motion_time),
              ClearanceAt(course, course.start.p, motion_time) > config.radius);
    num_arrivals += expected.has_value() ? 1 : 0;
  }
  EXPECT_GT(num_arrivals, 8);
}

}  // namespace
}  // namespace slalom::sim
