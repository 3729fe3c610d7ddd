#include "sim/courses/indoor_generators.h"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "base/random.h"
#include "sim/courses/clutter.h"
#include "sim/courses/numbered_courses.h"
#include "sim/courses/reference_path.h"

namespace slalom::sim {
namespace {

constexpr double kWholeProbability = 0.15;
constexpr double kDoorPost = 0.2;       // Wall beside a door, at least, [m].
constexpr double kDoorSpace = 0.8;      // From furniture to the middle of a door, [m].
constexpr double kStandingSpace = 0.6;  // From obstacles to start and goal, [m].

/// A floor while it is cut into rooms.
class Floor {
 public:
  Floor(const RoomRecipe& recipe, base::Random& random) : recipe_(recipe), random_(random) {}

  /// Cuts `part` into rooms and corridors.
  void Cut(const Bounds& part) {
    const base::Vec2 size = part.max_W - part.min_W;
    const bool along_x = size.x >= size.y;
    const double length = along_x ? size.x : size.y;
    if (length < 2.0 * recipe_.min_room || random_.Uniform() < kWholeProbability) {
      rooms_.push_back(part);
      return;
    }
    double corridor = 0.0;
    if (random_.Uniform() < recipe_.corridor_probability) {
      corridor = random_.Uniform(recipe_.min_corridor, recipe_.max_corridor);
    }
    if (length < 2.0 * recipe_.min_room + corridor) corridor = 0.0;
    const auto cut = DrawCut(part, along_x, corridor);
    if (!cut) {
      rooms_.push_back(part);
      return;
    }
    const auto [first, second] = *cut;
    for (const double at : {first, second}) {
      AddWall(part, along_x, at);
      if (corridor == 0.0) break;
    }
    Bounds low = part, high = part;
    (along_x ? low.max_W.x : low.max_W.y) = first;
    (along_x ? high.min_W.x : high.min_W.y) = second;
    Cut(low);
    Cut(high);
  }

  const std::vector<Bounds>& rooms() const { return rooms_; }
  const std::vector<Box>& walls() const { return walls_; }
  const std::vector<base::Vec2>& doors() const { return doors_; }

 private:
  /// Where the walls of a cut stand, both the same without a corridor. Nothing if each place that
  /// was tried would bar a door.
  std::optional<std::pair<double, double>> DrawCut(const Bounds& part, bool along_x,
                                                   double corridor) {
    constexpr int kMaxDraws = 10;
    const double low = (along_x ? part.min_W.x : part.min_W.y) + recipe_.min_room;
    const double high = (along_x ? part.max_W.x : part.max_W.y) - recipe_.min_room - corridor;
    for (int i = 0; i < kMaxDraws; ++i) {
      const double first = random_.Uniform(low, high);
      const double second = first + corridor;
      const bool bars = std::ranges::any_of(doors_, [&](base::Vec2 door) {
        const double at = along_x ? door.x : door.y;
        const double across = along_x ? door.y : door.x;
        const bool is_of_part = across > (along_x ? part.min_W.y : part.min_W.x) - kThinWall &&
                                across < (along_x ? part.max_W.y : part.max_W.x) + kThinWall;
        const double reach = 0.5 * recipe_.max_door + kDoorPost;
        return is_of_part && (std::abs(at - first) < reach || std::abs(at - second) < reach);
      });
      if (!bars) return std::pair(first, second);
    }
    return std::nullopt;
  }

  /// A wall across the part, with one or two doors.
  void AddWall(const Bounds& part, bool along_x, double at) {
    const double begin = along_x ? part.min_W.y : part.min_W.x;
    const double end = along_x ? part.max_W.y : part.max_W.x;
    const auto point = [&](double across) {
      return along_x ? base::Vec2{at, across} : base::Vec2{across, at};
    };
    // Of two doors each has half of the wall, if there is room.
    const double post = kDoorPost + 0.5 * kThinWall;
    const double least = recipe_.max_door + 2.0 * post;
    const bool has_two =
        random_.Uniform() < recipe_.second_door_probability && end - begin >= 2.0 * least;
    const int num_doors = has_two ? 2 : 1;
    const double share = (end - begin) / num_doors;
    double from = begin;
    for (int i = 0; i < num_doors; ++i) {
      const double half = 0.5 * random_.Uniform(recipe_.min_door, recipe_.max_door);
      const double low = begin + i * share + post + half;
      const double high = begin + (i + 1) * share - post - half;
      const double middle = random_.Uniform(low, high);
      doors_.push_back(point(middle));
      walls_.push_back(Between(point(from), point(middle - half)));
      from = middle + half;
    }
    walls_.push_back(Between(point(from), point(end)));
  }

  /// A piece of wall that ends at its points, so that doors keep their width.
  static Box Between(base::Vec2 from_W, base::Vec2 to_W) {
    const base::Vec2 along = to_W - from_W;
    const base::Vec2 trim = 0.5 * kThinWall / base::Norm(along) * along;
    return WallBetween(from_W + trim, to_W - trim);
  }

  const RoomRecipe& recipe_;
  base::Random& random_;
  std::vector<Bounds> rooms_;  // Without corridors.
  std::vector<Box> walls_;
  std::vector<base::Vec2> doors_;  // Their middles.
};

Piece DrawFurniture(const Bounds& room, base::Random& random) {
  base::Pose2 X_WB = DrawPose(room, 0.3, random);
  switch (random.UniformInt(5)) {
    case 0: {  // A table.
      const double x = random.Uniform(0.3, 0.7);
      const double y = random.Uniform(0.25, 0.5);
      return LegsAt(DrawPose(room, 0.9, random), {x, y}, 0.03);  // All legs are inside.
    }
    case 1:  // A chair.
      return LegsAt(X_WB, {0.2, 0.2}, 0.02);
    case 2: {  // A crate.
      const double x = random.Uniform(0.2, 0.8);
      const double y = random.Uniform(0.2, 0.8);
      return {{}, {{X_WB, {0.5 * x, 0.5 * y}}}};
    }
    case 3: {  // A shelf, along a wall.
      X_WB.yaw = random.Uniform() < 0.5 ? 0.0 : 0.5 * base::kPi;
      const double length = random.Uniform(0.6, 1.8);
      return {{}, {{X_WB, {0.5 * length, 0.2}}}};
    }
    default:  // A bin.
      return {{{X_WB.p, random.Uniform(0.1, 0.3)}}, {}};
  }
}

/// A floor with start and goal in two rooms, or nothing if it has only one.
std::optional<Course> DrawFloor(const RoomRecipe& recipe, base::Random& random) {
  Course course;
  const double width = random.Uniform(recipe.min_side, recipe.max_side);
  const double depth = random.Uniform(recipe.min_side, recipe.max_side);
  const Bounds all{{-0.5 * width, -0.5 * depth}, {0.5 * width, 0.5 * depth}};
  Enclose(all, course);
  Floor floor(recipe, random);
  floor.Cut(all);
  const std::vector<Bounds>& rooms = floor.rooms();
  if (rooms.size() < 2) return std::nullopt;
  course.boxes.insert(course.boxes.end(), floor.walls().begin(), floor.walls().end());
  const std::size_t from = random.UniformInt(rooms.size());
  const std::size_t to = (from + 1 + random.UniformInt(rooms.size() - 1)) % rooms.size();
  const double margin = kStandingSpace + 0.5 * kThinWall;
  course.start = DrawPose(rooms[from], margin, random);
  course.goal_W = DrawPose(rooms[to], margin, random).p;
  for (const Bounds& room : rooms) {
    const base::Vec2 size = room.max_W - room.min_W;
    const double density = random.Uniform(0.0, recipe.max_furniture);
    const int num_pieces = static_cast<int>(density * size.x * size.y);
    for (int i = 0; i < num_pieces; ++i) {
      const Piece piece = DrawFurniture(room, random);
      const bool bars = std::ranges::any_of(
          floor.doors(), [&](base::Vec2 door) { return DistanceTo(piece, door) < kDoorSpace; });
      if (DistanceToEnds(piece, course) >= kStandingSpace && !bars) Add(piece, course);
    }
  }
  return course;
}

}  // namespace

Course GenerateRoomCourse(std::string name, const RoomRecipe& recipe, std::uint64_t seed) {
  base::Random random(seed);
  while (true) {
    std::optional<Course> course = DrawFloor(recipe, random);
    if (!course || !AddReferencePath(*course, recipe.clearance)) continue;
    course->name = std::move(name);
    return *std::move(course);
  }
}

CourseSet GenerateFreshRoomCourses(std::uint64_t seed, int count) {
  return MakeNumberedCourses("fresh-rooms", seed, 0, count,
                             [](std::string name, int, std::uint64_t own) {
                               return GenerateRoomCourse(std::move(name), {}, own);
                             });
}

namespace {

constexpr double kEndMargin = 0.8;  // From the walls to start and goal, [m].
constexpr double kEndSpace = 0.6;   // From clutter to start and goal, [m].

/// A box whose sides are drawn from these ranges.
Piece DrawBox(const base::Pose2& X_WB, base::Vec2 x_range, base::Vec2 y_range,
              base::Random& random) {
  const double x = random.Uniform(x_range.x, x_range.y);
  const double y = random.Uniform(y_range.x, y_range.y);
  return {{}, {{X_WB, {0.5 * x, 0.5 * y}}}};
}

Piece DrawPiece(const Bounds& hall, base::Random& random) {
  base::Pose2 X_WB = DrawPose(hall, 0.0, random);
  switch (random.UniformInt(10)) {
    case 0:
    case 1:
    case 2:
      return {{{X_WB.p, random.Uniform(0.1, 0.5)}}, {}};
    case 3:
    case 4:
    case 5:
      return DrawBox(X_WB, {0.2, 1.5}, {0.2, 1.5}, random);
    case 6:
    case 7:
      return DrawBox(X_WB, {1.0, 4.0}, {0.2, 0.5}, random);
    case 8:
      X_WB.yaw = random.Uniform() < 0.5 ? 0.0 : 0.5 * base::kPi;
      return DrawBox(X_WB, {3.0, 8.0}, {kThinWall, kThinWall}, random);
    default: {
      const double x = random.Uniform(0.25, 0.75);
      const double y = random.Uniform(0.25, 0.75);
      return LegsAt(DrawPose(hall, 1.1, random), {x, y}, 0.03);  // All legs are inside.
    }
  }
}

Course DrawHall(const HallRecipe& recipe, base::Random& random) {
  Course course;
  const double width = random.Uniform(recipe.min_side, recipe.max_side);
  const double depth = random.Uniform(recipe.min_side, recipe.max_side);
  const Bounds hall{{-0.5 * width, -0.5 * depth}, {0.5 * width, 0.5 * depth}};
  Enclose(hall, course);
  do {
    course.start = DrawPose(hall, kEndMargin, random);
    course.goal_W = DrawPose(hall, kEndMargin, random).p;
  } while (base::Norm(course.goal_W - course.start.p) < recipe.min_distance);
  const double density = random.Uniform(recipe.min_density, recipe.max_density);
  const int num_pieces = static_cast<int>(density * width * depth);
  for (int i = 0; i < num_pieces; ++i) {
    const Piece piece = DrawPiece(hall, random);
    if (DistanceToEnds(piece, course) >= kEndSpace) Add(piece, course);
  }
  return course;
}

}  // namespace

Course GenerateHallCourse(std::string name, const HallRecipe& recipe, std::uint64_t seed) {
  base::Random random(seed);
  while (true) {
    Course course = DrawHall(recipe, random);
    if (!AddReferencePath(course, recipe.clearance)) continue;
    course.name = std::move(name);
    return course;
  }
}

CourseSet GenerateFreshHallCourses(std::uint64_t seed, int count) {
  return MakeNumberedCourses("fresh-halls", seed, 0, count,
                             [](std::string name, int, std::uint64_t own) {
                               return GenerateHallCourse(std::move(name), {}, own);
                             });
}

}  // namespace slalom::sim
