#include "sim/courses/real_world_courses.h"

#include <array>
#include <utility>

namespace slalom::sim {
namespace {

/// Puts walls and furniture into a course whose start is the origin. Lengths in metres.
class Room {
 public:
  Room(std::string name, base::Vec2 goal_W, const Bounds& bounds) {
    course_.name = std::move(name);
    course_.goal_W = goal_W;
    course_.bounds = bounds;
  }

  /// A wall 0.1 m thick along x or y.
  void Wall(base::Vec2 from_W, base::Vec2 to_W) {
    const base::Vec2 reach = 0.5 * (to_W - from_W);
    constexpr double kHalf = 0.05;
    course_.boxes.push_back({{0.5 * (from_W + to_W), 0.0}, {reach.x + kHalf, reach.y + kHalf}});
  }

  /// A box, a shelf, a sofa, a bench: sizes along its own x and y.
  void Block(double x, double y, double yaw, double size_x, double size_y) {
    course_.boxes.push_back({{{x, y}, yaw}, {0.5 * size_x, 0.5 * size_y}});
  }

  /// A pillar, a bin, the foot of an office chair.
  void Cylinder(double x, double y, double radius) { course_.circles.push_back({{x, y}, radius}); }

  void Table(double x, double y, double yaw, double size_x, double size_y) {
    constexpr double kInset = 0.05;
    Legs({{x, y}, yaw}, {0.5 * size_x - kInset, 0.5 * size_y - kInset}, 0.03);
  }

  /// Its legs are 0.36 m apart, too close for the robot.
  void Chair(double x, double y, double yaw) { Legs({{x, y}, yaw}, {0.2, 0.2}, 0.02); }

  void Path(std::vector<base::Vec2> points_W) { course_.reference_path_W = std::move(points_W); }

  Course Take() { return std::move(course_); }

 private:
  void Legs(const base::Pose2& X_WB, base::Vec2 reach, double radius) {
    for (const base::Vec2 side : {base::Vec2{1, 1}, {-1, 1}, {-1, -1}, {1, -1}}) {
      course_.circles.push_back(
          {base::Transform(X_WB, {side.x * reach.x, side.y * reach.y}), radius});
    }
  }

  Course course_;
};

/// Three rows of cardboard boxes between walls 4.5 m apart, each with one gap, never in line.
Course BenchmarkLike() {
  Room room("real-world-1", {6.0, 0.0}, {{-1.0, -2.4}, {6.6, 2.4}});
  room.Wall({-0.9, -2.25}, {5.35, -2.25});
  room.Wall({-0.9, 2.25}, {5.35, 2.25});
  room.Wall({-0.9, -2.25}, {-0.9, 2.25});
  // First row: a gap of 0.9 m ahead, slightly to the left.
  room.Block(1.55, -1.92, 0.10, 0.50, 0.60);
  room.Block(1.68, -1.36, -0.30, 0.50, 0.45);
  room.Block(1.50, -0.80, 0.20, 0.45, 0.50);
  room.Block(1.30, -0.55, 0.60, 0.30, 0.30);
  room.Block(1.55, 0.88, -0.15, 0.50, 0.50);
  room.Block(1.70, 1.45, 0.40, 0.45, 0.45);
  room.Block(1.50, 1.98, 0.05, 0.60, 0.40);
  // Second row: the gap is to the right.
  room.Block(2.80, 1.95, 0.20, 0.50, 0.50);
  room.Block(2.95, 1.40, -0.20, 0.45, 0.50);
  room.Block(2.75, 0.82, 0.35, 0.50, 0.50);
  room.Block(2.90, 0.28, -0.10, 0.45, 0.45);
  room.Block(2.80, -0.22, 0.15, 0.50, 0.40);
  room.Block(2.70, -1.72, -0.25, 0.55, 0.50);
  room.Block(2.95, -2.05, 0.05, 0.45, 0.30);
  // Third row: to the left.
  room.Block(4.25, -1.98, -0.10, 0.55, 0.45);
  room.Block(4.15, -1.45, 0.30, 0.45, 0.45);
  room.Block(4.30, -0.90, -0.20, 0.50, 0.50);
  room.Block(4.20, -0.38, 0.10, 0.40, 0.45);
  room.Block(4.25, 1.15, 0.25, 0.45, 0.45);
  room.Block(4.35, 1.70, -0.15, 0.50, 0.50);
  room.Block(4.20, 2.05, 0.00, 0.40, 0.30);
  room.Path({{1.0, 0.12},
             {1.75, 0.1},
             {2.2, -0.65},
             {2.75, -0.95},
             {3.25, -0.92},
             {3.52, -0.2},
             {3.9, 0.35},
             {4.9, 0.35}});
  return room.Take();
}

/// A sitting room, a dining room and a study, in line but with the doors out of line.
Course Indoor() {
  Room room("real-world-2", {7.5, -1.1}, {{-1.1, -2.5}, {8.5, 2.7}});
  room.Wall({-1.0, -2.4}, {8.4, -2.4});
  room.Wall({-1.0, 2.6}, {8.4, 2.6});
  room.Wall({-1.0, -2.4}, {-1.0, 2.6});
  room.Wall({8.4, -2.4}, {8.4, 2.6});
  // Sitting room: a low table with chairs stands in the straight way to the door.
  room.Block(0.3, 2.15, 0.0, 1.8, 0.8);
  room.Table(1.35, -0.6, 0.1, 1.2, 0.7);
  room.Chair(1.85, 0.05, 0.3);
  room.Chair(0.7, -1.3, -0.4);
  room.Chair(1.75, -1.3, 0.2);
  room.Cylinder(2.5, 2.1, 0.2);
  room.Block(2.9, -2.15, 0.0, 0.8, 0.4);
  room.Block(-0.7, -1.4, 0.0, 0.4, 1.2);
  // The first door, 0.95 m wide.
  room.Wall({3.4, -2.4}, {3.4, -0.2});
  room.Wall({3.4, 0.75}, {3.4, 2.6});
  // Dining room: one may drive round or between the legs.
  room.Table(4.75, 1.35, 0.0, 1.6, 0.9);
  room.Chair(4.3, 0.62, 0.1);
  room.Chair(5.15, 0.55, -0.2);
  room.Chair(4.4, 2.1, 0.0);
  room.Chair(5.2, 2.15, 0.15);
  room.Cylinder(3.85, -1.1, 0.3);
  room.Block(4.6, -2.15, 0.0, 1.4, 0.4);
  room.Chair(5.2, -0.6, 0.5);
  room.Cylinder(5.85, 0.3, 0.15);
  // The second door, 0.9 m wide, is to the right.
  room.Wall({6.2, -2.4}, {6.2, -1.75});
  room.Wall({6.2, -0.85}, {6.2, 2.6});
  // Study.
  room.Table(7.6, 0.5, 1.57, 1.6, 0.8);
  room.Cylinder(6.95, 0.2, 0.3);
  room.Block(8.2, -2.0, 0.0, 0.3, 0.7);
  room.Block(6.55, 2.1, 0.0, 0.5, 0.9);
  room.Path({{0.9, 0.5},
             {1.75, 0.75},
             {2.6, 0.55},
             {3.4, 0.25},
             {4.1, -0.1},
             {4.52, -0.75},
             {4.75, -1.3},
             {5.5, -1.35},
             {6.2, -1.3}});
  return room.Take();
}

/// A hall 5 m wide. Half walls from the right and from the left make two bends. No trap: the
/// paper's policies without memory went through theirs at 1.4 m/s in the mean.
Course LongHall() {
  Room room("real-world-3", {30.0, 0.0}, {{-1.1, -2.6}, {31.1, 2.6}});
  room.Wall({-1.0, -2.5}, {31.0, -2.5});
  room.Wall({-1.0, 2.5}, {31.0, 2.5});
  room.Wall({-1.0, -2.5}, {-1.0, 2.5});
  // Two rows of pillars, and boxes between them.
  for (const double x : {3.0, 7.0, 16.0, 20.0, 27.0}) {
    room.Cylinder(x, 1.3, 0.2);
    room.Cylinder(x, -1.3, 0.2);
  }
  room.Block(3.0, 0.25, 0.5, 0.6, 0.4);
  room.Block(5.0, -0.55, -0.3, 0.5, 0.5);
  room.Block(5.2, 0.9, 0.2, 0.6, 0.5);
  room.Block(7.2, 0.05, 0.8, 0.4, 0.4);
  room.Block(8.6, 1.5, 0.0, 0.5, 1.6);
  // From the right.
  room.Wall({12.0, -2.5}, {12.0, 0.7});
  room.Block(10.4, -1.9, 0.3, 0.6, 0.6);
  room.Block(12.6, 2.15, 0.0, 1.2, 0.5);
  room.Block(14.9, 0.55, 0.4, 0.5, 0.5);
  room.Block(14.2, -1.2, -0.2, 0.6, 0.5);
  // From the left.
  room.Wall({18.0, -0.7}, {18.0, 2.5});
  room.Block(16.8, 0.2, 0.1, 0.5, 0.6);
  room.Block(18.6, -2.15, 0.0, 1.6, 0.5);
  // Benches across the hall, staggered.
  room.Block(21.6, -1.7, 0.0, 0.45, 1.5);
  room.Block(22.8, 1.0, 0.0, 0.45, 2.0);
  room.Block(24.2, -1.1, 0.0, 0.45, 2.0);
  room.Chair(25.5, 1.3, 0.3);
  room.Chair(25.6, -0.35, -0.2);
  room.Cylinder(26.2, -1.9, 0.3);
  room.Block(28.0, -0.1, 0.6, 0.5, 0.5);
  room.Path({{2.0, -0.3},   {3.0, -0.5},  {4.1, 0.1},   {5.6, 0.2},   {6.4, -0.5},  {7.6, -0.6},
             {9.0, 0.2},    {11.0, 1.05}, {12.2, 1.3},  {13.3, 0.9},  {14.0, 0.1},  {14.9, -0.35},
             {16.2, -0.55}, {17.4, -1.2}, {18.4, -1.3}, {20.4, -0.4}, {21.9, -0.4}, {23.2, -0.5},
             {23.65, 0.3},  {24.6, 0.5},  {25.5, 0.5},  {27.2, 0.65}, {28.2, 0.62}});
  return room.Take();
}

}  // namespace

Course RealWorldCourse(int number) {
  constexpr std::array kMakers = {BenchmarkLike, Indoor, LongHall};
  static_assert(kMakers.size() == kNumRealWorldCourses);
  return kMakers.at(static_cast<std::size_t>(number - 1))();
}

}  // namespace slalom::sim
