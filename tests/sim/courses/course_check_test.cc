#include "sim/courses/course_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "base/random.h"
#include "sim/courses/motion.h"

namespace slalom::sim {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// 20 m x 20 m, from (11, 0) to (-9, 0), with a cylinder that crosses from y = -10 to y = 10.
Course OpenCourse() {
  Course course;
  course.name = "open";
  course.start = {{11.0, 0.0}, base::kPi};
  course.goal_W = {-9.0, 0.0};
  course.bounds = {{-11.0, -11.0}, {12.0, 11.0}};
  course.circles.push_back({{0.0, 3.0}, 0.5});
  course.boxes.push_back({{{2.0, -4.0}, 0.4}, {0.5, 1.0}});
  course.moving.push_back({.radius = 0.5,
                           .half_size = {},
                           .key_frames = {{0.0, {{1.0, -10.0}, 0.0}}, {10.0, {{1.0, 10.0}, 0.0}}},
                           .playback = Playback::kLoop});
  return course;
}

std::string Refusal(const Course& course) { return WhyUnsolvable(course).value_or(""); }

TEST(CourseCheck, NumbersThatAreNoneAndSizesThatAreNotAboveZeroAreRefused) {
  EXPECT_EQ(Refusal(OpenCourse()), "");
  const auto refusal = [](const auto& spoil) {
    Course course = OpenCourse();
    spoil(course);
    return Refusal(course);
  };
  EXPECT_THAT(refusal([](Course& c) { c.start.yaw = kNan; }), HasSubstr("start"));
  EXPECT_THAT(refusal([](Course& c) { c.start.p.x = kNan; }), HasSubstr("start"));
  EXPECT_THAT(refusal([](Course& c) { c.goal_W.y = kNan; }), HasSubstr("goal"));
  EXPECT_THAT(refusal([](Course& c) { c.bounds.max_W.x = INFINITY; }), HasSubstr("bounds"));
  EXPECT_THAT(refusal([](Course& c) { c.circles[0].p_W.x = kNan; }), HasSubstr("cylinder 0"));
  EXPECT_THAT(refusal([](Course& c) { c.circles[0].radius = -0.5; }), HasSubstr("radius -0.5"));
  EXPECT_THAT(refusal([](Course& c) { c.circles[0].radius = 0.0; }), HasSubstr("cylinder 0"));
  EXPECT_THAT(refusal([](Course& c) { c.boxes[0].half_size.y = -1.0; }), HasSubstr("box 0"));
  EXPECT_THAT(refusal([](Course& c) { c.boxes[0].X_WB.yaw = INFINITY; }), HasSubstr("box 0"));
  EXPECT_THAT(refusal([](Course& c) { c.moving[0].radius = -0.5; }), HasSubstr("has no size"));
  EXPECT_THAT(refusal([](Course& c) { c.moving[0].radius = 0.0; }), HasSubstr("moving obstacle 0"));
  EXPECT_THAT(refusal([](Course& c) { c.moving[0].key_frames.pop_back(); }),
              HasSubstr("1 key frames, expected 2 or more"));
  EXPECT_THAT(refusal([](Course& c) { c.moving[0].key_frames[1].X_WB.p.y = kNan; }),
              HasSubstr("key frame 1"));
  EXPECT_THAT(refusal([](Course& c) { c.moving[0].key_frames[0].time = 0.5; }),
              HasSubstr("the first key frame is at 0.5 s, expected 0"));
  EXPECT_THAT(refusal([](Course& c) { c.moving[0].key_frames[1].time = 0.0; }),
              HasSubstr("key frame 1 is at 0 s, which is not after"));
  // 20 m: at 0.2 s they are driven at 100 m/s, which is still believed.
  EXPECT_EQ(refusal([](Course& c) { c.moving[0].key_frames[1].time = 0.2; }), "");
  EXPECT_THAT(refusal([](Course& c) { c.moving[0].key_frames[1].time = 0.199; }),
              HasSubstr("at most 100"));
}

// As headings turn the shorter way, half a turn is the most there is to turn.
TEST(CourseCheck, HeadingsOnBothSidesOfPiAreNear) {
  Course course = OpenCourse();
  course.moving[0].key_frames = {{0.0, {{0.0, 0.0}, 3.1}}, {0.01, {{0.0, 0.0}, -3.1}}};
  EXPECT_EQ(Refusal(course), "");
  course.moving[0].key_frames[1].X_WB.yaw = 1.1;
  EXPECT_THAT(Refusal(course), HasSubstr("rad/s"));
}

TEST(CourseCheck, OnlyFixedObstaclesDecideWhetherACourseCanBeDriven) {
  Course course = OpenCourse();
  // A moving wall from side to side, over start and goal.
  course.moving[0].radius = 0.0;
  course.moving[0].half_size = {12.0, 11.0};
  EXPECT_EQ(Refusal(course), "");
  course.boxes.push_back({{{0.0, 0.0}, 0.0}, {0.1, 11.0}});
  EXPECT_THAT(Refusal(course), HasSubstr("no corridor"));
}

TEST(CourseCheck, WhatDrivesOverTheStartIsReported) {
  Course course = OpenCourse();
  EXPECT_THAT(CourseWarnings(course), IsEmpty());
  // The robot's front is at x = 11 - 0.229; the cylinder's right side passes at x + 0.5.
  for (const double x : {10.26, 10.28}) {
    for (KeyFrame& frame : course.moving[0].key_frames) frame.X_WB.p.x = x;
    EXPECT_EQ(CourseWarnings(course).size(), x < 10.27 ? 0u : 1u) << x;
  }
  EXPECT_THAT(CourseWarnings(course),
              ElementsAre(HasSubstr("1 of 1 moving obstacles drive over a robot that waits")));
  // Ping-pong takes the same way back, so neither finds more.
  course.moving[0].playback = Playback::kPingPong;
  EXPECT_EQ(CourseWarnings(course).size(), 1u);
}

TEST(CourseCheck, WhatNeverMovesIsReported) {
  Course course = OpenCourse();
  course.moving.push_back(course.moving[0]);
  course.moving[1].key_frames[1].X_WB = course.moving[1].key_frames[0].X_WB;
  EXPECT_THAT(CourseWarnings(course), ElementsAre(HasSubstr("stand still")));
}

std::vector<base::Vec2> CornersOf(const Box& box) {
  std::vector<base::Vec2> points;
  for (const base::Vec2 c : {base::Vec2{1, 1}, {-1, 1}, {-1, -1}, {1, -1}}) {
    points.push_back(base::Transform(box.X_WB, {c.x * box.half_size.x, c.y * box.half_size.y}));
  }
  return points;
}

TEST(CourseBounds, IncludeWhatTheyAreToldToAndNoMore) {
  base::Random random(32);
  const Bounds nothing{{0.5, 0.5}, {0.5, 0.5}};
  for (int i = 0; i < 200; ++i) {
    const Box box{
        {{random.Uniform(-2.0, 2.0), random.Uniform(-2.0, 2.0)}, random.Uniform(-7.0, 7.0)},
        {random.Uniform(0.1, 2.0), random.Uniform(0.1, 2.0)}};
    Bounds expected = nothing;
    for (const base::Vec2& p : CornersOf(box)) {
      expected = {{std::min(expected.min_W.x, p.x), std::min(expected.min_W.y, p.y)},
                  {std::max(expected.max_W.x, p.x), std::max(expected.max_W.y, p.y)}};
    }
    const Bounds bounds = Including(nothing, box);
    EXPECT_NEAR(bounds.min_W.x, expected.min_W.x, 1e-12);
    EXPECT_NEAR(bounds.min_W.y, expected.min_W.y, 1e-12);
    EXPECT_NEAR(bounds.max_W.x, expected.max_W.x, 1e-12);
    EXPECT_NEAR(bounds.max_W.y, expected.max_W.y, 1e-12);
  }
  EXPECT_EQ(Including(nothing, Circle{{1.0, 0.5}, 0.25}), (Bounds{{0.5, 0.25}, {1.25, 0.75}}));
  EXPECT_EQ(Including({{-9.0, -9.0}, {9.0, 9.0}}, Circle{{1.0, 0.5}, 0.25}),
            (Bounds{{-9.0, -9.0}, {9.0, 9.0}}));
}

/// Whether two convex outlines of four corners share a point: one has a corner in the other, or two
/// edges cross.
bool Overlap(const Box& a, const Box& b) {
  const auto holds = [](const Box& box, base::Vec2 p_W) {
    const base::Vec2 p = base::InverseTransform(box.X_WB, p_W);
    return std::abs(p.x) <= box.half_size.x && std::abs(p.y) <= box.half_size.y;
  };
  const auto pa = CornersOf(a), pb = CornersOf(b);
  for (std::size_t i = 0; i < 4; ++i) {
    if (holds(b, pa[i]) || holds(a, pb[i])) return true;
    for (std::size_t j = 0; j < 4; ++j) {
      const base::Vec2 p = pa[i], q = pa[(i + 1) % 4], r = pb[j], s = pb[(j + 1) % 4];
      if (base::Cross(q - p, r - p) * base::Cross(q - p, s - p) < 0 &&
          base::Cross(s - r, p - r) * base::Cross(s - r, q - r) < 0) {
        return true;
      }
    }
  }
  return false;
}

// Against another test of overlap at several times as many moments. What grazes the outline by less
// than a step may be missed by one of the two, so it is left out: those that a robot one step
// larger or smaller tells apart.
TEST(CourseCheck, WarningsAgreeWithADenserLook) {
  base::Random random(31);
  int num_over = 0, num_clear = 0;
  for (int i = 0; i < 60; ++i) {
    Course course = OpenCourse();
    course.circles.clear();
    course.boxes.clear();
    MovingObstacle& box = course.moving[0];
    box.radius = 0.0;
    box.half_size = {random.Uniform(0.1, 0.6), random.Uniform(0.1, 0.6)};
    box.key_frames.clear();
    for (int k = 0; k < 4; ++k) {
      box.key_frames.push_back(
          {2.0 * k,
           {{random.Uniform(9.0, 13.0), random.Uniform(-2.0, 2.0)}, random.Uniform(-3.0, 3.0)}});
    }
    const Motion motion(box);
    const auto touches = [&](double margin) {
      const Box outline{course.start, {0.229 + margin, 0.208 + margin}};
      for (int n = 0; n < 4000; ++n) {
        if (Overlap(outline, {motion.At(6.0 * n / 4000).X_WB, box.half_size})) return true;
      }
      return false;
    };
    if (touches(0.02) != touches(-0.02)) continue;
    EXPECT_EQ(!CourseWarnings(course).empty(), touches(0.0)) << "draw " << i;
    ++(touches(0.0) ? num_over : num_clear);
  }
  EXPECT_GT(num_over, 10);
  EXPECT_GT(num_clear, 10);
}

}  // namespace
}  // namespace slalom::sim
