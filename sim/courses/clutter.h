#pragma once

#include <vector>

#include "base/geometry.h"
#include "base/random.h"
#include "sim/courses/course.h"

/// Walls and furniture that generators put into courses.

namespace slalom::sim {

/// Thickness of a wall, [m].
inline constexpr double kThinWall = 0.1;

/// A wall from one point to another, `kThinWall` thick, which reaches half of that beyond both
/// ends. Requires: the points differ in one coordinate alone.
Box WallBetween(base::Vec2 from_W, base::Vec2 to_W);

/// Adds the four walls round a rectangle, on its sides, and sets the bounds, which hold them.
void Enclose(const Bounds& inside, Course& course);

/// Obstacles that stand together.
struct Piece {
  std::vector<Circle> circles;
  std::vector<Box> boxes;
};

/// Four cylinders at the corners of a rectangle.
Piece LegsAt(const base::Pose2& X_WB, base::Vec2 half_size, double radius);

/// Distance from a point to the nearest obstacle of the piece; 0 or less inside one.
double DistanceTo(const Piece& piece, base::Vec2 p_W);

void Add(const Piece& piece, Course& course);

/// Distance from the piece to the nearer one of start and goal.
double DistanceToEnds(const Piece& piece, const Course& course);

/// A point of a rectangle at least `margin` from its sides, and any heading.
base::Pose2 DrawPose(const Bounds& inside, double margin, base::Random& random);

}  // namespace slalom::sim
