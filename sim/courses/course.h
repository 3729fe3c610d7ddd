#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/geometry.h"

/// Frames: `W` the course's own frame, `B` a box, `R` the robot.

namespace slalom::sim {

/// A vertical cylinder.
struct Circle {
  base::Vec2 p_W;       ///< Centre, [m].
  double radius = 0.0;  ///< [m]

  friend bool operator==(const Circle&, const Circle&) = default;
};

/// An upright box.
struct Box {
  base::Pose2 X_WB;      ///< Pose of the centre.
  base::Vec2 half_size;  ///< Along B's x and y, [m].

  friend bool operator==(const Box&, const Box&) = default;
};

/// A pose at a time, [s] since the motion began.
struct KeyFrame {
  double time = 0.0;
  base::Pose2 X_WB;

  friend bool operator==(const KeyFrame&, const KeyFrame&) = default;
};

/// Behaviour of an obstacle after its last key frame: kLoop jumps back to the first, kPingPong
/// drives the same way back.
enum class Playback { kLoop, kPingPong };

/// A cylinder or an upright box that follows its key frames for ever. Nothing stops it
/// (docs/original-system.md, section 7.4).
struct MovingObstacle {
  double radius = 0.0;               ///< Radius of a cylinder, [m]; 0 for a box.
  base::Vec2 half_size;              ///< Half size of a box along B's x and y, [m].
  std::vector<KeyFrame> key_frames;  ///< Two or more, times strictly ascending from 0.
  Playback playback = Playback::kLoop;

  friend bool operator==(const MovingObstacle&, const MovingObstacle&) = default;
};

/// The corners of the area that a course covers, [m].
struct Bounds {
  base::Vec2 min_W;
  base::Vec2 max_W;

  friend bool operator==(const Bounds&, const Bounds&) = default;
};

/// The smallest bounds that hold `bounds` and the obstacle.
Bounds Including(Bounds bounds, const Circle& circle);
Bounds Including(Bounds bounds, const Box& box);

/// Distances from a point to the obstacle, 0 or less inside.
double DistanceTo(const Circle& circle, base::Vec2 p_W);
double DistanceTo(const Box& box, base::Vec2 p_W);

/// Mean over the reference path of the five measures of Perille et al. 2020
/// (docs/original-system.md, section 7.1), in cells of 0.15 m, not normalised.
struct Difficulty {
  double distance_to_obstacle = 0.0;
  double visibility = 0.0;
  double dispersion = 0.0;
  double characteristic_dimension = 0.0;
  double tortuosity = 0.0;

  friend bool operator==(const Difficulty&, const Difficulty&) = default;
};

/// An obstacle course. It is plain data and never changes once made, so any number of threads may
/// share it.
struct Course {
  std::string name;  ///< Unique in its set; letters, digits, '-', '_', '.'.
  base::Pose2 start;
  base::Vec2 goal_W;
  Bounds bounds;
  std::vector<Circle> circles;
  std::vector<Box> boxes;
  std::vector<MovingObstacle> moving;
  std::vector<base::Vec2>
      reference_path_W;  ///< Through the field, without start and goal; may be empty.
  std::optional<Difficulty> difficulty;

  friend bool operator==(const Course&, const Course&) = default;
};

/// Length of the way from the start along the reference path to the goal, [m], or of the straight
/// line if the course has no path. The BARN score's optimal time is this length divided by 2 m/s.
double ReferenceLength(const Course& course);

/// A named list of courses.
struct CourseSet {
  std::string name;
  std::vector<std::shared_ptr<const Course>> courses;
};

}  // namespace slalom::sim
