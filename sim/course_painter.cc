#include "sim/course_painter.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "base/check.h"
#include "sim/course_check.h"

namespace slalom::sim {
namespace {

constexpr Colour kFloor{0.955, 0.96, 0.965};
constexpr Colour kObstacle{0.26, 0.30, 0.36};
constexpr Colour kEnds{0.13, 0.39, 0.83};  // Start and goal.
constexpr double kGoalTolerance = 0.4;     // [m], within which the goal counts as reached.
constexpr double kOutlineSpacing = 1.0;    // [m] between outlines along a track.

}  // namespace

Colour OutcomeColour(env::Outcome outcome) {
  switch (outcome) {
    case env::Outcome::kSuccess:
      return {0.07, 0.60, 0.42};
    case env::Outcome::kCollision:
      return {0.84, 0.19, 0.15};
    case env::Outcome::kTimeout:
      return {0.93, 0.58, 0.07};
    case env::Outcome::kRunning:
      return {0.50, 0.36, 0.72};
  }
  base::CheckFailed(__FILE__, __LINE__, "an outcome that is none");
}

void SetColour(cairo_t* cairo, Colour colour, double alpha) {
  cairo_set_source_rgba(cairo, colour.red, colour.green, colour.blue, alpha);
}

void CoursePainter::PaintCourse(const Course& course) {
  const Bounds& bounds = course.bounds;
  cairo_rectangle(cairo_, bounds.min_W.x, bounds.min_W.y, bounds.max_W.x - bounds.min_W.x,
                  bounds.max_W.y - bounds.min_W.y);
  SetColour(cairo_, kFloor);
  cairo_fill(cairo_);

  PaintGoal(course.goal_W, kGoalTolerance);
  std::vector<base::Vec2> way = {course.start.p};
  way.insert(way.end(), course.reference_path_W.begin(), course.reference_path_W.end());
  way.push_back(course.goal_W);
  PaintDashes(way, 0.035);

  SetColour(cairo_, kObstacle);
  for (const Circle& circle : course.circles) {
    cairo_new_sub_path(cairo_);
    cairo_arc(cairo_, circle.p_W.x, circle.p_W.y, circle.radius, 0.0, 2.0 * base::kPi);
  }
  for (const Box& box : course.boxes) {
    for (const base::Vec2 corner : {base::Vec2{1, 1}, {-1, 1}, {-1, -1}, {1, -1}}) {
      const base::Vec2 p =
          base::Transform(box.X_WB, {corner.x * box.half_size.x, corner.y * box.half_size.y});
      if (corner == base::Vec2{1, 1}) {
        cairo_move_to(cairo_, p.x, p.y);
      } else {
        cairo_line_to(cairo_, p.x, p.y);
      }
    }
    cairo_close_path(cairo_);
  }
  cairo_fill(cairo_);
}

void CoursePainter::TraceOutline(const base::Pose2& X_WR) {
  constexpr double kX = 0.5 * kRobotLength;
  constexpr double kY = 0.5 * kRobotWidth;
  constexpr std::array<base::Vec2, 4> kCorners = {{{kX, kY}, {-kX, kY}, {-kX, -kY}, {kX, -kY}}};
  cairo_new_sub_path(cairo_);
  for (const base::Vec2& corner : kCorners) {
    const base::Vec2 p = base::Transform(X_WR, corner);
    cairo_line_to(cairo_, p.x, p.y);
  }
  cairo_close_path(cairo_);
}

void CoursePainter::PaintStart(const base::Pose2& X_WR) {
  TraceOutline(X_WR);
  SetColour(cairo_, kEnds, 0.18);
  cairo_fill_preserve(cairo_);
  SetColour(cairo_, kEnds);
  cairo_set_line_width(cairo_, 0.03);
  cairo_stroke(cairo_);

  constexpr std::array<base::Vec2, 7> kArrow = {{{-0.12, 0.03},
                                                 {0.26, 0.03},
                                                 {0.26, 0.11},
                                                 {0.46, 0.0},
                                                 {0.26, -0.11},
                                                 {0.26, -0.03},
                                                 {-0.12, -0.03}}};
  for (const base::Vec2& point : kArrow) {
    const base::Vec2 p = base::Transform(X_WR, point);
    cairo_line_to(cairo_, p.x, p.y);
  }
  cairo_close_path(cairo_);
  cairo_fill(cairo_);
}

void CoursePainter::PaintTrack(const EpisodeTrack& track) {
  if (track.poses.empty()) return;
  const Colour colour = OutcomeColour(track.outcome);
  double since_outline = 0.0;
  cairo_set_line_width(cairo_, 0.012);
  for (std::size_t i = 1; i < track.poses.size(); ++i) {
    since_outline += base::Norm(track.poses[i].p - track.poses[i - 1].p);
    if (since_outline < kOutlineSpacing) continue;
    since_outline = 0.0;
    TraceOutline(track.poses[i]);
  }
  SetColour(cairo_, colour, 0.35);
  cairo_stroke(cairo_);

  for (const base::Pose2& pose : track.poses) cairo_line_to(cairo_, pose.p.x, pose.p.y);
  SetColour(cairo_, colour, 0.85);
  cairo_set_line_width(cairo_, 0.04);
  cairo_set_line_join(cairo_, CAIRO_LINE_JOIN_ROUND);
  cairo_stroke(cairo_);

  const base::Pose2& end = track.poses.back();
  TraceOutline(end);
  SetColour(cairo_, colour, 0.15);
  cairo_fill_preserve(cairo_);
  SetColour(cairo_, colour, 0.9);
  cairo_set_line_width(cairo_, 0.025);
  cairo_stroke(cairo_);
  PaintEndMark(end.p, 0.09, track.outcome);
}

void CoursePainter::PaintEndMark(base::Vec2 p, double radius, env::Outcome outcome) {
  SetColour(cairo_, OutcomeColour(outcome));
  cairo_set_line_width(cairo_, 0.5 * radius);
  switch (outcome) {
    case env::Outcome::kSuccess:
      cairo_arc(cairo_, p.x, p.y, radius, 0.0, 2.0 * base::kPi);
      cairo_fill(cairo_);
      break;
    case env::Outcome::kCollision:
      cairo_move_to(cairo_, p.x - radius, p.y - radius);
      cairo_line_to(cairo_, p.x + radius, p.y + radius);
      cairo_move_to(cairo_, p.x - radius, p.y + radius);
      cairo_line_to(cairo_, p.x + radius, p.y - radius);
      cairo_stroke(cairo_);
      break;
    case env::Outcome::kTimeout:
    case env::Outcome::kRunning:
      cairo_rectangle(cairo_, p.x - radius, p.y - radius, 2.0 * radius, 2.0 * radius);
      cairo_fill(cairo_);
      break;
  }
}

void CoursePainter::PaintGoal(base::Vec2 p, double radius) {
  cairo_arc(cairo_, p.x, p.y, radius, 0.0, 2.0 * base::kPi);
  SetColour(cairo_, kEnds, 0.12);
  cairo_fill_preserve(cairo_);
  SetColour(cairo_, kEnds);
  cairo_set_line_width(cairo_, 0.075 * radius);
  cairo_stroke(cairo_);
  cairo_arc(cairo_, p.x, p.y, 0.16 * radius, 0.0, 2.0 * base::kPi);
  cairo_fill(cairo_);
}

void CoursePainter::PaintDashes(std::span<const base::Vec2> points, double width) {
  const std::array<double, 2> dashes = {2.2 * width, 2.0 * width};
  cairo_save(cairo_);
  cairo_set_dash(cairo_, dashes.data(), 2, 0.0);
  cairo_set_line_width(cairo_, width);
  cairo_set_line_join(cairo_, CAIRO_LINE_JOIN_ROUND);
  for (const base::Vec2& p : points) cairo_line_to(cairo_, p.x, p.y);
  SetColour(cairo_, kMuted, 0.7);
  cairo_stroke(cairo_);
  cairo_restore(cairo_);
}

}  // namespace slalom::sim
