#include "sim/pictures/course_painter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "base/check.h"
#include "sim/courses/course_check.h"
#include "sim/courses/motion.h"
#include "sim/pictures/guard_marks.h"

namespace slalom::sim {
namespace {

constexpr Colour kObstacle{0.26, 0.30, 0.36};
constexpr Colour kEnds{0.13, 0.39, 0.83};  // Start and goal.
constexpr double kGoalTolerance = 0.4;     // [m], within which the goal counts as reached.
constexpr double kOutlineSpacing = 1.0;    // [m] between outlines along a track.
constexpr double kGhostInterval = 1.0;     // [s] between outlines of a moving obstacle.
constexpr int kMaxGhosts = 200;
constexpr double kMinLineWidth = 0.6;   // [pixels]
constexpr double kMinArrowSize = 6.0;   // [pixels]
constexpr double kMarkRadius = 0.05;    // Of a guard's mark, [m].
constexpr double kMinMarkRadius = 2.0;  // [pixels]

/// Points along the way of the obstacle's centre, from the first key frame to the last.
std::vector<base::Vec2> WayOf(const MovingObstacle& obstacle, const Motion& motion) {
  const double duration = obstacle.key_frames.back().time;
  const int num_steps = 24 * static_cast<int>(obstacle.key_frames.size() - 1);
  std::vector<base::Vec2> way;
  way.reserve(static_cast<std::size_t>(num_steps) + 1);
  for (int i = 0; i < num_steps; ++i) way.push_back(motion.At(duration * i / num_steps).X_WB.p);
  way.push_back(obstacle.key_frames.back().X_WB.p);
  return way;
}

}  // namespace

Bounds IncludingSweep(Bounds bounds, const MovingObstacle& obstacle) {
  const Motion motion(obstacle);
  if (obstacle.radius > 0.0) {
    for (const base::Vec2& p : WayOf(obstacle, motion)) {
      bounds = Including(bounds, Circle{p, obstacle.radius});
    }
    return bounds;
  }
  constexpr int kNumSteps = 200;
  const double duration = obstacle.key_frames.back().time;
  for (int i = 0; i < kNumSteps; ++i) {
    const base::Pose2 X_WB = motion.At(duration * i / kNumSteps).X_WB;
    bounds = Including(bounds, Box{X_WB, obstacle.half_size});
  }
  return Including(bounds, Box{obstacle.key_frames.back().X_WB, obstacle.half_size});
}

Bounds ViewOf(const CourseScene& scene) {
  constexpr double kReach = 0.35;  // [m] round each pose.
  Bounds view = scene.course->bounds;
  for (const MovingObstacle& obstacle : scene.course->moving) view = IncludingSweep(view, obstacle);
  for (const EpisodeTrack& track : scene.tracks) {
    for (const base::Pose2& pose : track.poses) {
      view.min_W.x = std::min(view.min_W.x, pose.p.x - kReach);
      view.min_W.y = std::min(view.min_W.y, pose.p.y - kReach);
      view.max_W.x = std::max(view.max_W.x, pose.p.x + kReach);
      view.max_W.y = std::max(view.max_W.y, pose.p.y + kReach);
    }
  }
  return view;
}

Colour OutcomeColour(env::Outcome outcome) {
  switch (outcome) {
    case env::Outcome::kSuccess:
      return {0.07, 0.60, 0.42};
    case env::Outcome::kCollision:
      return {0.84, 0.19, 0.15};
    case env::Outcome::kTimeout:
      return {0.93, 0.58, 0.07};
    case env::Outcome::kTerminated:
    case env::Outcome::kRunning:
      return {0.50, 0.36, 0.72};
  }
  base::CheckFailed(__FILE__, __LINE__, "an outcome that is none");
}

void SetColour(cairo_t* cairo, Colour colour, double alpha) {
  cairo_set_source_rgba(cairo, colour.red, colour.green, colour.blue, alpha);
}

void CoursePainter::PaintCourse(const Course& course) {
  PaintFixed(course);
  for (const MovingObstacle& obstacle : course.moving) PaintMoving(obstacle);
}

void CoursePainter::PaintFixed(const Course& course) {
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
  for (const Circle& circle : course.circles) TraceCircle(circle);
  for (const Box& box : course.boxes) TraceBox(box);
  cairo_fill(cairo_);
}

void CoursePainter::PaintMovingAt(const MovingObstacle& obstacle, const base::Pose2& X_WB) {
  if (obstacle.radius > 0.0) {
    TraceCircle({X_WB.p, obstacle.radius});
  } else {
    TraceBox({X_WB, obstacle.half_size});
  }
  SetColour(cairo_, kMoving);
  cairo_fill(cairo_);
}

void CoursePainter::PaintMoving(const MovingObstacle& obstacle) {
  const Motion motion(obstacle);
  const auto trace = [&](const base::Pose2& X_WB) {
    if (obstacle.radius > 0.0) {
      TraceCircle({X_WB.p, obstacle.radius});
    } else {
      TraceBox({X_WB, obstacle.half_size});
    }
  };
  const double duration = obstacle.key_frames.back().time;
  const double interval = std::max(kGhostInterval, duration / kMaxGhosts);
  for (int i = 1; i * interval < duration; ++i) trace(motion.At(i * interval).X_WB);
  trace(obstacle.key_frames.back().X_WB);
  SetColour(cairo_, kMoving, 0.3);
  SetLineWidth(0.015);
  cairo_stroke(cairo_);

  std::vector<base::Vec2> way = WayOf(obstacle, motion);
  SetColour(cairo_, kMoving, 0.55);
  const double arrow_size = std::max(0.2, kMinArrowSize * PixelSize());
  PaintArrow(way, arrow_size, 0.025);
  if (obstacle.playback == Playback::kPingPong) {
    std::reverse(way.begin(), way.end());
    PaintArrow(way, arrow_size, 0.025);
  }
  trace(obstacle.key_frames.front().X_WB);
  SetColour(cairo_, kMoving);
  cairo_fill(cairo_);
}

void CoursePainter::PaintMovingSymbol(base::Vec2 p, double reach) {
  SetColour(cairo_, kMoving);
  PaintArrow(std::array<base::Vec2, 2>{{{p.x - reach, p.y}, {p.x + reach, p.y}}}, 0.6 * reach,
             0.12 * reach);
  TraceBox({{{p.x - 0.6 * reach, p.y}, 0.0}, {0.4 * reach, 0.4 * reach}});
  cairo_fill(cairo_);
}

void CoursePainter::PaintArrow(std::span<const base::Vec2> points, double size, double width) {
  // The head points away from the last point that is as far from the tip as the head is long.
  const base::Vec2 tip = points.back();
  base::Vec2 from = points.front();
  for (const base::Vec2& p : points) {
    if (base::Norm(tip - p) >= size) from = p;
  }
  for (const base::Vec2& p : points) cairo_line_to(cairo_, p.x, p.y);
  SetLineWidth(width);
  cairo_stroke(cairo_);
  const double length = base::Norm(tip - from);
  if (!(length > 0.0)) return;
  const base::Vec2 ahead = (size / length) * (tip - from);
  const base::Vec2 left = {-0.35 * ahead.y, 0.35 * ahead.x};
  for (const base::Vec2& p : {tip, tip - ahead + left, tip - ahead - left}) {
    cairo_line_to(cairo_, p.x, p.y);
  }
  cairo_close_path(cairo_);
  cairo_fill(cairo_);
}

double CoursePainter::PixelSize() const {
  double x = 1.0, y = 0.0;
  cairo_device_to_user_distance(cairo_, &x, &y);
  return std::sqrt(x * x + y * y);
}

void CoursePainter::SetLineWidth(double width) {
  cairo_set_line_width(cairo_, std::max(width, kMinLineWidth * PixelSize()));
}

void CoursePainter::TraceCircle(const Circle& circle) {
  cairo_new_sub_path(cairo_);
  cairo_arc(cairo_, circle.p_W.x, circle.p_W.y, circle.radius, 0.0, 2.0 * base::kPi);
}

void CoursePainter::TraceBox(const Box& box) {
  cairo_new_sub_path(cairo_);
  for (const base::Vec2 corner : {base::Vec2{1, 1}, {-1, 1}, {-1, -1}, {1, -1}}) {
    const base::Vec2 p =
        base::Transform(box.X_WB, {corner.x * box.half_size.x, corner.y * box.half_size.y});
    cairo_line_to(cairo_, p.x, p.y);
  }
  cairo_close_path(cairo_);
}

void CoursePainter::TraceOutline(const base::Pose2& X_WR) {
  TraceBox({X_WR, {0.5 * kRobotLength, 0.5 * kRobotWidth}});
}

void CoursePainter::PaintStart(const base::Pose2& X_WR) {
  TraceOutline(X_WR);
  SetColour(cairo_, kEnds, 0.18);
  cairo_fill_preserve(cairo_);
  SetColour(cairo_, kEnds);
  SetLineWidth(0.03);
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

void CoursePainter::PaintTrail(std::span<const base::Vec2> points, Colour colour) {
  for (const base::Vec2& p : points) cairo_line_to(cairo_, p.x, p.y);
  SetColour(cairo_, colour, 0.85);
  SetLineWidth(0.05);
  cairo_set_line_join(cairo_, CAIRO_LINE_JOIN_ROUND);
  cairo_stroke(cairo_);
}

void CoursePainter::PaintRobot(const base::Pose2& X_WR, Colour colour) {
  TraceOutline(X_WR);
  SetColour(cairo_, colour);
  cairo_fill_preserve(cairo_);
  SetColour(cairo_, {1.0, 1.0, 1.0});
  SetLineWidth(0.02);
  cairo_stroke(cairo_);
  for (const base::Vec2 nose : {base::Vec2{0.16, 0.0}, {-0.04, 0.11}, {-0.04, -0.11}}) {
    const base::Vec2 p = base::Transform(X_WR, nose);
    cairo_line_to(cairo_, p.x, p.y);
  }
  cairo_close_path(cairo_);
  SetColour(cairo_, {1.0, 1.0, 1.0}, 0.9);
  cairo_fill(cairo_);
}

void CoursePainter::PaintTrack(const EpisodeTrack& track) {
  if (track.poses.empty()) return;
  const Colour colour = OutcomeColour(track.outcome);
  double since_outline = 0.0;
  SetLineWidth(0.012);
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
  SetLineWidth(0.04);
  cairo_set_line_join(cairo_, CAIRO_LINE_JOIN_ROUND);
  cairo_stroke(cairo_);
  PaintGuardMarks(track, std::numeric_limits<double>::infinity(), colour);

  const base::Pose2& end = track.poses.back();
  TraceOutline(end);
  SetColour(cairo_, colour, 0.15);
  cairo_fill_preserve(cairo_);
  SetColour(cairo_, colour, 0.9);
  SetLineWidth(0.025);
  cairo_stroke(cairo_);
  PaintEndMark(end.p, 0.09, track.outcome);
}

void CoursePainter::PaintGuardMarks(const EpisodeTrack& track, double time, Colour colour) {
  const double radius = std::max(kMarkRadius, kMinMarkRadius * PixelSize());
  for (const std::size_t i : GuardMarks(track, 2.0 * radius)) {
    if (track.step * static_cast<double>(i) > time) return;
    PaintGuardMark(track.poses[i].p, radius, colour);
  }
}

void CoursePainter::PaintGuardMark(base::Vec2 p, double radius, Colour colour) {
  cairo_new_sub_path(cairo_);
  cairo_arc(cairo_, p.x, p.y, radius, 0.0, 2.0 * base::kPi);
  SetColour(cairo_, {1.0, 1.0, 1.0});
  cairo_fill_preserve(cairo_);
  SetColour(cairo_, colour);
  SetLineWidth(0.4 * radius);
  cairo_stroke(cairo_);
}

void CoursePainter::PaintEndMark(base::Vec2 p, double radius, env::Outcome outcome) {
  SetColour(cairo_, OutcomeColour(outcome));
  SetLineWidth(0.5 * radius);
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
    case env::Outcome::kTerminated:
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
  SetLineWidth(0.075 * radius);
  cairo_stroke(cairo_);
  cairo_arc(cairo_, p.x, p.y, 0.16 * radius, 0.0, 2.0 * base::kPi);
  cairo_fill(cairo_);
}

void CoursePainter::PaintDashes(std::span<const base::Vec2> points, double width) {
  width = std::max(width, kMinLineWidth * PixelSize());
  const std::array<double, 2> dashes = {2.2 * width, 2.0 * width};
  cairo_save(cairo_);
  cairo_set_dash(cairo_, dashes.data(), 2, 0.0);
  SetLineWidth(width);
  cairo_set_line_join(cairo_, CAIRO_LINE_JOIN_ROUND);
  for (const base::Vec2& p : points) cairo_line_to(cairo_, p.x, p.y);
  SetColour(cairo_, kMuted, 0.7);
  cairo_stroke(cairo_);
  cairo_restore(cairo_);
}

}  // namespace slalom::sim
