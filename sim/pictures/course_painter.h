#pragma once

#include <cairo.h>

#include <span>

#include "sim/courses/course.h"
#include "sim/pictures/course_render.h"

namespace slalom::sim {

/// A colour, each part from 0 to 1.
struct Colour {
  double red;
  double green;
  double blue;
};

inline constexpr Colour kFloor{0.955, 0.96, 0.965};
inline constexpr Colour kInk{0.15, 0.17, 0.20};
inline constexpr Colour kMoving{0.70, 0.36, 0.10};  ///< Obstacles that move.
inline constexpr Colour kMuted{0.45, 0.48, 0.52};

/// The colour that a track of this outcome has in all pictures.
Colour OutcomeColour(env::Outcome outcome);

void SetColour(cairo_t* cairo, Colour colour, double alpha = 1.0);

/// Widens `bounds` by everything that a moving obstacle covers on its way.
Bounds IncludingSweep(Bounds bounds, const MovingObstacle& obstacle);

/// Returns the part of the plane that a scene needs: the course's bounds, the ways of its moving
/// obstacles and a margin round each pose of the tracks.
Bounds ViewOf(const CourseScene& scene);

/// Draws in the course's frame W. The caller has set up a transformation from metres, y up, to the
/// page. Confined to the thread that owns the context.
class CoursePainter {
 public:
  explicit CoursePainter(cairo_t* cairo) : cairo_(cairo) {}

  /// Draws floor, obstacles, goal and reference path.
  void PaintCourse(const Course& course);
  /// Draws the same without moving obstacles.
  void PaintFixed(const Course& course);
  /// Draws a moving obstacle at one of its poses.
  void PaintMovingAt(const MovingObstacle& obstacle, const base::Pose2& X_WB);
  /// Draws a line through the robot's past places.
  void PaintTrail(std::span<const base::Vec2> points, Colour colour);
  /// Draws the robot filled, with a mark that points ahead.
  void PaintRobot(const base::Pose2& X_WR, Colour colour);
  /// Draws the obstacle filled where it begins, its outline at each second, and the way of its
  /// centre with an arrow at the end (with ping-pong playback, at both ends).
  void PaintMoving(const MovingObstacle& obstacle);
  /// Draws the robot at the start, with an arrow ahead.
  void PaintStart(const base::Pose2& X_WR);
  /// Draws the line of the track, the robot's outline every metre and at the end, a ring where a
  /// guard changed the action, and an end mark.
  void PaintTrack(const EpisodeTrack& track);
  /// Draws the rings of the guard, as far as the drive has gone by `time` [s].
  void PaintGuardMarks(const EpisodeTrack& track, double time, Colour colour);

  // Symbols, also used by the legend. `radius` is in the unit of the context.
  void PaintEndMark(base::Vec2 p, double radius, env::Outcome outcome);
  void PaintGuardMark(base::Vec2 p, double radius, Colour colour);
  void PaintGoal(base::Vec2 p, double radius);
  void PaintDashes(std::span<const base::Vec2> points, double width);
  /// A moving obstacle at the left, its way to the right, 2 * `reach` wide.
  void PaintMovingSymbol(base::Vec2 p, double reach);
  /// A line with an arrowhead `size` long at its end, in the colour that is set.
  void PaintArrow(std::span<const base::Vec2> points, double size, double width);

 private:
  /// The size of a pixel of a PNG or a point of an SVG, in the unit of the context.
  double PixelSize() const;
  /// `width`, but never so thin that it cannot be seen.
  void SetLineWidth(double width);
  void TraceBox(const Box& box);
  void TraceCircle(const Circle& circle);
  void TraceOutline(const base::Pose2& X_WR);

  cairo_t* const cairo_;
};

}  // namespace slalom::sim
