#include "sim/pictures/course_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <vector>

#include "sim/courses/course_difficulty.h"
#include "sim/courses/motion.h"

namespace slalom::sim {
namespace {

constexpr double kCharacterWidth = 0.15;  // [m]; a character of a terminal is about twice as high.
constexpr int kMaxColumns = 120;

/// A grid of characters over the bounds of a course.
class TextCanvas {
 public:
  explicit TextCanvas(const Bounds& bounds)
      : origin_W_(bounds.min_W),
        width_(std::max(kCharacterWidth, (bounds.max_W.x - bounds.min_W.x) / kMaxColumns)),
        num_columns_(Count(bounds.max_W.x - bounds.min_W.x, width_)),
        lines_(static_cast<std::size_t>(Count(bounds.max_W.y - bounds.min_W.y, 2.0 * width_)),
               std::string(static_cast<std::size_t>(num_columns_), '.')) {}

  void Put(base::Vec2 p_W, char c) {
    const double column = std::floor((p_W.x - origin_W_.x) / width_);
    const double line = std::floor((p_W.y - origin_W_.y) / (2.0 * width_));
    if (column < 0 || column >= num_columns_ || line < 0 ||
        line >= static_cast<double>(lines_.size())) {
      return;
    }
    lines_[static_cast<std::size_t>(line)][static_cast<std::size_t>(column)] = c;
  }

  std::string Text() const {
    std::string text;
    for (auto line = lines_.rbegin(); line != lines_.rend(); ++line) text += *line + "\n";
    return text;
  }

 private:
  static int Count(double extent, double size) {
    return std::max(1, static_cast<int>(std::ceil(extent / size - 1e-9)));
  }

  const base::Vec2 origin_W_;
  const double width_;  // [m] of a character.
  const int num_columns_;
  std::vector<std::string> lines_;  // From the smallest y up.
};

/// Points close enough to touch every character that the circle covers, and its centre.
void PutCircle(TextCanvas& canvas, const Circle& circle, char c) {
  canvas.Put(circle.p_W, c);
  const int num_rings = static_cast<int>(circle.radius / kCharacterWidth) + 1;
  for (int ring = 1; ring <= num_rings; ++ring) {
    const double radius = 0.95 * circle.radius * ring / num_rings;
    const int num_points = 8 * ring;
    for (int i = 0; i < num_points; ++i) {
      const auto direction = base::SinCos(2.0 * base::kPi * i / num_points);
      canvas.Put(circle.p_W + radius * base::Vec2{direction.cos, direction.sin}, c);
    }
  }
}

void PutBox(TextCanvas& canvas, const Box& box, char c) {
  const int num_x = static_cast<int>(2.0 * box.half_size.x / (0.5 * kCharacterWidth)) + 2;
  const int num_y = static_cast<int>(2.0 * box.half_size.y / (0.5 * kCharacterWidth)) + 2;
  for (int x = 0; x < num_x; ++x) {
    for (int y = 0; y < num_y; ++y) {
      canvas.Put(base::Transform(box.X_WB, {box.half_size.x * (2.0 * x / (num_x - 1) - 1.0),
                                            box.half_size.y * (2.0 * y / (num_y - 1) - 1.0)}),
                 c);
    }
  }
}

/// The way of the obstacle's centre, from the first key frame to the last.
void PutWay(TextCanvas& canvas, const MovingObstacle& obstacle, char c) {
  constexpr int kNumPoints = 1000;
  const Motion motion(obstacle);
  const double duration = obstacle.key_frames.back().time;
  for (int i = 0; i < kNumPoints; ++i) canvas.Put(motion.At(duration * i / kNumPoints).X_WB.p, c);
}

/// "2 moving: rounds of 3.0 to 4.5 s, 1.2 m/s in the mean, at most 1.9 m/s".
std::string DescribeMoving(const Course& course) {
  const std::vector<MovingObstacle>& moving = course.moving;
  double shortest = 1e9, longest = 0.0, fastest = 0.0;
  for (const MovingObstacle& obstacle : moving) {
    const Motion motion(obstacle);
    shortest = std::min(shortest, motion.period());
    longest = std::max(longest, motion.period());
    fastest = std::max(fastest, motion.max_speed());
  }
  return fmt::format(
      "{} moving: rounds of {:.1f} to {:.1f} s, {:.2f} m/s in the mean, at most {:.2f} m/s",
      moving.size(), shortest, longest, MeasureMotion(course).mean_speed, fastest);
}

}  // namespace

std::string DrawText(const Course& course) {
  TextCanvas canvas(course.bounds);
  for (const MovingObstacle& obstacle : course.moving) PutWay(canvas, obstacle, ':');
  for (const base::Vec2& p : course.reference_path_W) canvas.Put(p, 'o');
  for (const Circle& circle : course.circles) PutCircle(canvas, circle, '#');
  for (const Box& box : course.boxes) PutBox(canvas, box, '#');
  for (const MovingObstacle& obstacle : course.moving) {
    const base::Pose2& X_WB = obstacle.key_frames.front().X_WB;
    if (obstacle.radius > 0.0) {
      PutCircle(canvas, {X_WB.p, obstacle.radius}, 'm');
    } else {
      PutBox(canvas, {X_WB, obstacle.half_size}, 'm');
    }
  }
  canvas.Put(course.goal_W, 'G');
  canvas.Put(course.start.p, 'S');
  return canvas.Text();
}

std::string DescribeText(const Course& course) {
  std::string text;
  auto out = std::back_inserter(text);
  fmt::format_to(out, "map:             S start, G goal, # obstacle{}{}\n",
                 course.reference_path_W.empty() ? "" : ", o reference path",
                 course.moving.empty() ? "" : ", m moving obstacle, : its way");
  fmt::format_to(out, "name:            {}\n", course.name);
  fmt::format_to(out, "start:           x {} m, y {} m, yaw {} rad\n", course.start.p.x,
                 course.start.p.y, course.start.yaw);
  fmt::format_to(out, "goal:            x {} m, y {} m\n", course.goal_W.x, course.goal_W.y);
  fmt::format_to(out, "bounds:          x {} to {} m, y {} to {} m\n", course.bounds.min_W.x,
                 course.bounds.max_W.x, course.bounds.min_W.y, course.bounds.max_W.y);
  fmt::format_to(out, "obstacles:       {} cylinder{}, {} box{}\n", course.circles.size(),
                 course.circles.size() == 1 ? "" : "s", course.boxes.size(),
                 course.boxes.size() == 1 ? "" : "es");
  if (!course.moving.empty()) fmt::format_to(out, "                 {}\n", DescribeMoving(course));
  fmt::format_to(out, "reference path:  {:.3f} m from start to goal{}\n", ReferenceLength(course),
                 course.reference_path_W.empty() ? " (straight line: the course has no path)" : "");
  if (course.difficulty) {
    const Difficulty& d = *course.difficulty;
    fmt::format_to(out,
                   "difficulty:      distance to obstacle {:.3f} cells, visibility {:.3f} cells, "
                   "dispersion {:.3f},\n                 characteristic dimension {:.3f} cells, "
                   "tortuosity {:.4f}\n",
                   d.distance_to_obstacle, d.visibility, d.dispersion, d.characteristic_dimension,
                   d.tortuosity);
  }
  return text;
}

}  // namespace slalom::sim
