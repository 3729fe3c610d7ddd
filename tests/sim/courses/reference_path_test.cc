#include "sim/courses/reference_path.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "sim/courses/course_check.h"
#include "sim/courses/course_path.h"

namespace slalom::sim {
namespace {

using ::testing::IsEmpty;

/// From (0, 0) to (0, 6), with nothing between them.
Course Open() {
  Course course;
  course.name = "open";
  course.start = {{0.0, 0.0}, 1.5708};
  course.goal_W = {0.0, 6.0};
  course.bounds = {{-3.0, -1.0}, {3.0, 7.0}};
  return course;
}

/// A wall 0.2 m thick across the course at `y`, from x = `low` to x = `high`.
Box Wall(double y, double low, double high) {
  return {{{0.5 * (low + high), y}, 0.0}, {0.5 * (high - low), 0.1}};
}

double SmallestDistance(const Course& course, base::Vec2 p_W) {
  double distance = 1e9;
  for (const Circle& circle : course.circles)
    distance = std::min(distance, DistanceTo(circle, p_W));
  for (const Box& box : course.boxes) distance = std::min(distance, DistanceTo(box, p_W));
  return distance;
}

/// Checks that the path lies inside the bounds and leads the robot past all obstacles.
void ExpectDrivable(Course course) {
  ASSERT_EQ(WhyUnsolvable(course), std::nullopt);
  course.reference_path_W = FindReferencePath(course);
  ASSERT_FALSE(course.reference_path_W.empty());
  std::vector<base::Vec2> way = course.reference_path_W;
  way.insert(way.begin(), course.start.p);
  way.push_back(course.goal_W);
  // Between the centres of two cells a diagonal apart, 0.21 m, both of which are 0.208 m from a
  // point, the way is sqrt(0.208^2 - 0.106^2) = 0.179 m from it.
  for (std::size_t i = 0; i + 1 < way.size(); ++i) {
    for (double share = 0.0; share <= 1.0; share += 0.01) {
      const base::Vec2 p_W = way[i] + share * (way[i + 1] - way[i]);
      ASSERT_GT(SmallestDistance(course, p_W), 0.178) << p_W.x << ", " << p_W.y;
      ASSERT_GE(p_W.x, course.bounds.min_W.x);
      ASSERT_LE(p_W.x, course.bounds.max_W.x);
    }
  }
}

TEST(ReferencePath, IsAStraightLineIfThatIsFree) {
  Course course = Open();
  EXPECT_THAT(FindReferencePath(course), IsEmpty());
  course.circles.push_back({{0.3, 3.0}, 0.09});
  EXPECT_THAT(FindReferencePath(course), IsEmpty());
  course.circles.clear();
  course.moving.push_back({0.4, {}, {{0.0, {{0.0, 3.0}, 0.0}}, {9.0, {{0.0, 3.1}, 0.0}}}, {}});
  EXPECT_THAT(FindReferencePath(course), IsEmpty());
}

TEST(ReferencePath, LeadsRoundAWallByTheShorterWay) {
  Course course = Open();
  course.boxes.push_back(Wall(3.0, -3.0, 1.0));
  ExpectDrivable(course);
  course.reference_path_W = FindReferencePath(course);
  // No way is shorter than that past the robot's width beside the wall's end. Moves in eight
  // directions are at most 8.24 % longer than a straight line; three cells of 0.15 m from the
  // nearest blocked one, being near costs nothing any more.
  const auto past = [](double x) { return 2.0 * std::hypot(x, 3.0); };
  const double beside = 1.0 + 0.5 * kRobotWidth;
  EXPECT_GT(ReferenceLength(course), past(beside));
  EXPECT_LT(ReferenceLength(course), 1.0824 * past(beside + 3 * 0.15));
  for (const base::Vec2 p_W : course.reference_path_W) EXPECT_GE(p_W.x, -1e-9);
  Course mirrored = course;
  mirrored.reference_path_W.clear();
  mirrored.boxes = {Wall(3.0, -1.0, 3.0)};
  mirrored.reference_path_W = FindReferencePath(mirrored);
  EXPECT_NEAR(ReferenceLength(mirrored), ReferenceLength(course), 1e-9);
}

TEST(ReferencePath, LeadsThroughAZigzag) {
  Course course = Open();
  course.boxes = {Wall(1.5, -3.0, 1.5), Wall(3.0, -1.5, 3.0), Wall(4.5, -3.0, 1.5)};
  ExpectDrivable(course);
  course.start.p = {0.037, -0.061};  // Off the lattice of the goal.
  ExpectDrivable(course);
}

TEST(ReferencePath, TakesFinerCellsInANarrowGap) {
  Course course = Open();
  // A gap of 0.47 m, whose free middle is 0.054 m wide and lies between two cells of 0.15 m.
  course.boxes = {Wall(3.0, -3.0, 0.14), Wall(3.0, 0.61, 3.0)};
  ExpectDrivable(course);
}

TEST(ReferencePath, IsFoundOnAGridOfAnyShape) {
  PathGrid grid(40, 7);
  for (int col = 0; col < 6; ++col) grid.Block({20, col});
  const auto path = FindPath(grid, {0, 0}, {39, 0});
  ASSERT_TRUE(path);
  EXPECT_EQ(path->front(), (Cell{0, 0}));
  EXPECT_EQ(path->back(), (Cell{39, 0}));
  EXPECT_TRUE(std::ranges::find(*path, Cell{20, 6}) != path->end());
  grid.Block({20, 6});
  EXPECT_FALSE(FindPath(grid, {0, 0}, {39, 0}));
}

}  // namespace
}  // namespace slalom::sim
