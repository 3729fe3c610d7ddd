#include "sim/collision_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "tests/support/random_courses.h"

namespace slalom::sim {
namespace {

using base::Vec2;

constexpr Footprint kFootprint{.half_length = 0.229f, .half_width = 0.208f};

using Corners = std::array<Vec2, 4>;

Corners CornersOf(const base::Pose2& X, Vec2 half) {
  return {base::Transform(X, {-half.x, -half.y}), base::Transform(X, {half.x, -half.y}),
          base::Transform(X, {half.x, half.y}), base::Transform(X, {-half.x, half.y})};
}

double DistanceToSegment(Vec2 p, Vec2 a, Vec2 b) {
  const Vec2 d = b - a;
  const double t = std::clamp(base::Dot(p - a, d) / base::Dot(d, d), 0.0, 1.0);
  return base::Norm(p - (a + t * d));
}

bool Inside(const Corners& corners, Vec2 p) {
  for (int k = 0; k < 4; ++k) {
    if (base::Cross(corners[(k + 1) % 4] - corners[k], p - corners[k]) < 0.0) return false;
  }
  return true;
}

bool SegmentsCross(Vec2 a, Vec2 b, Vec2 c, Vec2 d) {
  const auto side = [](Vec2 p, Vec2 q, Vec2 r) { return base::Cross(q - p, r - p) > 0.0; };
  return side(a, b, c) != side(a, b, d) && side(c, d, a) != side(c, d, b);
}

// Exact distances in double precision by corners and edges, which `CollisionMap` does not use; 0
// where they overlap.
double DistanceToCircle(const Corners& robot, const Circle& circle) {
  if (Inside(robot, circle.p_W)) return 0.0;
  double nearest = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 4; ++k) {
    nearest = std::min(nearest, DistanceToSegment(circle.p_W, robot[k], robot[(k + 1) % 4]));
  }
  return std::max(0.0, nearest - circle.radius);
}

double DistanceToBox(const Corners& robot, const Box& box) {
  const Corners other = CornersOf(box.X_WB, box.half_size);
  if (Inside(robot, other[0]) || Inside(other, robot[0])) return 0.0;
  double nearest = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 4; ++k) {
      if (SegmentsCross(robot[i], robot[(i + 1) % 4], other[k], other[(k + 1) % 4])) return 0.0;
      nearest = std::min({nearest, DistanceToSegment(robot[i], other[k], other[(k + 1) % 4]),
                          DistanceToSegment(other[k], robot[i], robot[(i + 1) % 4])});
    }
  }
  return nearest;
}

// Coordinates below 8 m in single precision, a few operations: 8 m * 2^-24 * 10 = 5e-6 m.
constexpr double kRounding = 1e-5;
constexpr float kLimit = 0.4f;

float ClearanceAt(const CollisionMap& map, const base::Pose2& X_WR) {
  return map.Clearance(kFootprint, static_cast<float>(X_WR.p.x), static_cast<float>(X_WR.p.y),
                       static_cast<float>(X_WR.yaw), kLimit);
}

base::Pose2 RandomPose(base::Random& random) {
  return {{random.Uniform(-5.0, 5.0), random.Uniform(-5.0, 5.0)}, random.Uniform(-10.0, 10.0)};
}

TEST(CollisionMapTest, ClearanceToCirclesIsExact) {
  base::Random random(1);
  int touching = 0, near = 0;
  for (int round = 0; round < 100; ++round) {
    const auto course = test::RandomCourse(random, {.num_circles = 5 + round});
    const CollisionMap map(*course);
    for (int k = 0; k < 50; ++k) {
      const base::Pose2 X_WR = RandomPose(random);
      const Corners robot = CornersOf(X_WR, {kFootprint.half_length, kFootprint.half_width});
      double nearest = kLimit;
      for (const Circle& circle : course->circles) {
        nearest = std::min(nearest, DistanceToCircle(robot, circle));
      }
      const float found = ClearanceAt(map, X_WR);
      ASSERT_NEAR(std::max(found, 0.0f), nearest, kRounding);
      touching += nearest == 0.0;
      near += nearest > 0.0 && nearest < kLimit;
    }
  }
  EXPECT_GT(touching, 500);
  EXPECT_GT(near, 500);
}

TEST(CollisionMapTest, ClearanceToBoxesIsNeverTooLargeAndItsSignIsExact) {
  base::Random random(2);
  int touching = 0, apart = 0;
  for (int round = 0; round < 200; ++round) {
    const auto course = test::RandomCourse(random, {.num_circles = 0, .num_boxes = 1 + round % 10});
    const CollisionMap map(*course);
    for (int k = 0; k < 50; ++k) {
      const base::Pose2 X_WR = RandomPose(random);
      const Corners robot = CornersOf(X_WR, {kFootprint.half_length, kFootprint.half_width});
      double nearest = kLimit;
      for (const Box& box : course->boxes) nearest = std::min(nearest, DistanceToBox(robot, box));
      const float found = ClearanceAt(map, X_WR);
      ASSERT_LE(found, nearest + kRounding);
      if (nearest > kRounding) {
        ASSERT_GT(found, 0.0f);
        ++apart;
      } else if (nearest == 0.0) {
        ++touching;
      }
    }
  }
  EXPECT_GT(touching, 500);
  EXPECT_GT(apart, 500);
}

TEST(CollisionMapTest, FindCirclesMissesNone) {
  base::Random random(3);
  for (int round = 0; round < 50; ++round) {
    const auto course = test::RandomCourse(random, {.num_circles = 80, .max_radius = 1.0});
    const CollisionMap map(*course);
    for (int k = 0; k < 20; ++k) {
      const float x = static_cast<float>(random.Uniform(-9.0, 9.0));
      const float y = static_cast<float>(random.Uniform(-9.0, 9.0));
      const float reach = static_cast<float>(random.Uniform(0.0, 3.0));
      CollisionMap::Runs runs;
      map.FindCircles(x, y, reach, runs);
      int found = 0, previous_end = 0, wanted = 0;
      const auto in_reach = [&](int i) {
        return std::hypot(map.x()[i] - x, map.y()[i] - y) < reach + map.radius()[i];
      };
      for (const CollisionMap::Run& run : runs.span()) {
        ASSERT_GE(run.begin, previous_end);
        previous_end = run.end;
        for (int i = run.begin; i < run.end; ++i) found += in_reach(i);
      }
      for (int i = 0; i < map.num_circles(); ++i) wanted += in_reach(i);
      ASSERT_EQ(found, wanted);
    }
  }
}

TEST(CollisionMapTest, HoldsAnEmptyCourseAndAVeryWideOne) {
  EXPECT_EQ(ClearanceAt(CollisionMap(Course{}), {}), kLimit);
  Course wide;
  wide.circles = {{{-5000.0, 2.0}, 0.1}, {{0.5, 0.0}, 0.1}, {{3000.0, -4000.0}, 0.1}};
  EXPECT_NEAR(ClearanceAt(CollisionMap(wide), {}), 0.5 - 0.1 - 0.229, 1e-6);
}

}  // namespace
}  // namespace slalom::sim
