#include "sim/courses/indoor_generators.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/random.h"
#include "sim/courses/clutter.h"
#include "sim/courses/course_check.h"
#include "sim/courses/course_file.h"
#include "sim/courses/reference_path.h"
#include "tests/support/path_points.h"

namespace slalom::sim {
namespace {

struct Kind {
  std::string name;
  CourseSet (*generate)(std::uint64_t seed, int count);
  std::uint64_t checksum;  ///< Of the first six courses of seed 1.
};

class IndoorGenerator : public testing::TestWithParam<Kind> {
 protected:
  static constexpr int kNumCourses = 40;

  CourseSet Courses() const { return GetParam().generate(3, kNumCourses); }
};

double ClearanceAt(const Course& course, base::Vec2 p_W) {
  double nearest = 1e9;
  for (const Circle& circle : course.circles) nearest = std::min(nearest, DistanceTo(circle, p_W));
  for (const Box& box : course.boxes) nearest = std::min(nearest, DistanceTo(box, p_W));
  return nearest;
}

// On the lattice of the path the clearance is 0.35 m; between two cells 0.21 m apart it can be
// 0.015 m less: 0.35 - sqrt(0.35^2 - 0.106^2).
TEST_P(IndoorGenerator, TheRobotFitsThroughAllAlongTheReferencePath) {
  for (const auto& course : Courses().courses) {
    EXPECT_EQ(WhyUnsolvable(*course), std::nullopt) << course->name;
    for (const base::Vec2 p : test::PathPoints(*course, 0.02)) {
      ASSERT_GE(ClearanceAt(*course, p), 0.33) << course->name << " at " << p.x << ", " << p.y;
    }
  }
}

TEST_P(IndoorGenerator, EachCourseHasItsDifficulty) {
  std::set<double> widths;
  for (const auto& course : Courses().courses) {
    ASSERT_TRUE(course->difficulty.has_value());
    const Difficulty& d = *course->difficulty;
    EXPECT_GE(d.distance_to_obstacle, 1.0);
    EXPECT_GE(d.tortuosity, 1.0);
    EXPECT_GT(d.visibility, 0.0);
    widths.insert(d.characteristic_dimension);
    // On 8 moves a way is at most 1 / cos(pi / 8) = 1.08 times as long as the straight line, beside
    // the way round obstacles. The path ends at a cell, half a diagonal beside the goal at most.
    const double straight = base::Norm(course->goal_W - course->start.p);
    EXPECT_NEAR(d.tortuosity, ReferenceLength(*course) / straight, 0.12) << course->name;
  }
  EXPECT_GT(widths.size(), 30u);
}

TEST_P(IndoorGenerator, NothingIsOutsideAndNothingMoves) {
  for (const auto& course : Courses().courses) {
    EXPECT_TRUE(course->moving.empty());
    const Bounds& bounds = course->bounds;
    const auto is_inside = [&](base::Vec2 p) {
      return p.x >= bounds.min_W.x && p.x <= bounds.max_W.x && p.y >= bounds.min_W.y &&
             p.y <= bounds.max_W.y;
    };
    for (const Circle& circle : course->circles) EXPECT_TRUE(is_inside(circle.p_W));
    for (const Box& box : course->boxes) EXPECT_TRUE(is_inside(box.X_WB.p));
    // The walls have no gap: no point of the bounds' border is free for the robot.
    for (int i = 0; i <= 100; ++i) {
      const double x = bounds.min_W.x + 0.01 * i * (bounds.max_W.x - bounds.min_W.x);
      const double y = bounds.min_W.y + 0.01 * i * (bounds.max_W.y - bounds.min_W.y);
      for (const base::Vec2 p : {base::Vec2{x, bounds.min_W.y}, base::Vec2{x, bounds.max_W.y},
                                 base::Vec2{bounds.min_W.x, y}, base::Vec2{bounds.max_W.x, y}}) {
        EXPECT_LT(ClearanceAt(*course, p), 0.1);
      }
    }
  }
}

TEST_P(IndoorGenerator, CourseDependsOnSeedAndIndexAlone) {
  const auto generate = GetParam().generate;
  const CourseSet all = generate(5, 4);
  EXPECT_EQ(*all.courses[2], *generate(5, 3).courses[2]);
  EXPECT_EQ(all.courses[2]->name, fmt::format("fresh-{}-5-002", GetParam().name));
  EXPECT_NE(all.courses[0]->boxes, all.courses[1]->boxes);
  EXPECT_NE(all.courses[0]->boxes, generate(6, 1).courses[0]->boxes);
}

// The same bits in every build, on every machine, for good: results name courses by seed and index.
TEST_P(IndoorGenerator, CoursesNeverChange) {
  EXPECT_EQ(base::Checksum(PrintCourseSet(GetParam().generate(1, 6))), GetParam().checksum);
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, IndoorGenerator,
    testing::Values(Kind{"halls", GenerateFreshHallCourses, 8105741328002330714ull},
                    Kind{"rooms", GenerateFreshRoomCourses, 3717654809097115176ull}),
    [](const auto& info) { return info.param.name; });

TEST(HallGenerator, HallsAreLargeAndHoldAllShapes) {
  double longest = 0.0;
  for (const auto& course : GenerateFreshHallCourses(3, 40).courses) {
    const base::Vec2 size = course->bounds.max_W - course->bounds.min_W;
    for (const double side : {size.x, size.y}) {
      EXPECT_GE(side, 20.2);
      EXPECT_LE(side, 40.2);
    }
    const double distance = base::Norm(course->goal_W - course->start.p);
    EXPECT_GE(distance, 5.0);
    longest = std::max(longest, distance);
    EXPECT_GE(course->boxes.size(), 8u);
    EXPECT_FALSE(course->circles.empty());
    for (const base::Vec2 end : {course->start.p, course->goal_W}) {
      EXPECT_GE(ClearanceAt(*course, end), 0.6 - 1e-9);
    }
  }
  EXPECT_GT(longest, 25.0);
}

/// Places of a grid of 0.05 m that a disc reaches from the start, by its own flood fill.
std::vector<base::Vec2> Reached(const Course& course, double radius) {
  constexpr double kStep = 0.05;
  std::set<std::pair<int, int>> seen = {{0, 0}};
  std::vector<std::pair<int, int>> open = {{0, 0}};
  std::vector<base::Vec2> places;
  while (!open.empty()) {
    const auto [x, y] = open.back();
    open.pop_back();
    places.push_back(course.start.p + kStep * base::Vec2{double(x), double(y)});
    for (const std::pair<int, int>& to :
         {std::pair{x - 1, y}, {x + 1, y}, {x, y - 1}, {x, y + 1}}) {
      const base::Vec2 p = course.start.p + kStep * base::Vec2{double(to.first), double(to.second)};
      if (ClearanceAt(course, p) < radius || !seen.insert(to).second) continue;
      open.push_back(to);
    }
  }
  return places;
}

// Without furniture every room can be reached: later walls leave doors free.
TEST(RoomGenerator, EveryRoomHasADoor) {
  RoomRecipe recipe;
  recipe.max_furniture = 0.0;
  recipe.max_side = 14.0;
  for (std::uint64_t seed = 0; seed < 25; ++seed) {
    const Course course = GenerateRoomCourse("bare", recipe, seed);
    const std::vector<base::Vec2> reached = Reached(course, 0.35);
    base::Random random(seed);
    const Bounds inside{course.bounds.min_W + base::Vec2{0.1, 0.1},
                        course.bounds.max_W - base::Vec2{0.1, 0.1}};
    for (int i = 0; i < 150; ++i) {
      const base::Vec2 p = DrawPose(inside, 0.0, random).p;
      if (ClearanceAt(course, p) < 0.45) continue;
      EXPECT_TRUE(std::ranges::any_of(
          reached, [&](base::Vec2 place) { return base::Norm(place - p) < 0.06; }))
          << seed << " at " << p.x << ", " << p.y;
    }
  }
}

TEST(AddReferencePath, RefusesAPassageThatIsTooNarrow) {
  Course course;
  course.goal_W = {4.0, 0.0};
  course.bounds = {{-1.0, -2.0}, {5.0, 2.0}};
  const auto with_gap = [&](double width) {
    Course barred = course;
    barred.boxes = {WallBetween({2.0, -2.0}, {2.0, 1.0 - 0.5 * width}),
                    WallBetween({2.0, 1.0 + 0.5 * width}, {2.0, 2.0})};
    return barred;
  };
  // Walls reach 0.05 m beyond their ends.
  Course wide = with_gap(1.0);
  EXPECT_TRUE(AddReferencePath(wide, 0.35));
  EXPECT_FALSE(wide.reference_path_W.empty());
  Course narrow = with_gap(0.75);
  EXPECT_FALSE(AddReferencePath(narrow, 0.35));
  EXPECT_FALSE(narrow.difficulty.has_value());
  EXPECT_TRUE(AddReferencePath(course, 0.35));
  EXPECT_TRUE(course.reference_path_W.empty()) << "the straight line is free";
  EXPECT_DOUBLE_EQ(course.difficulty->tortuosity, 1.0);
}

}  // namespace
}  // namespace slalom::sim
