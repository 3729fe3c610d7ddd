#include "sim/courses/course_importer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "sim/courses/course_check.h"
#include "sim/courses/world_file.h"

namespace slalom::sim {
namespace {

constexpr double kWorldMargin = 1.0;  // Around the obstacles of a world, [m].

/// A rectangle of cells: columns x0 to x1 - 1 and rows y0 to y1 - 1.
struct CellRectangle {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

/// The cells of a map that are known, and one around them, which may be beyond the map's edge.
CellRectangle KnownCells(const OccupancyMap& map) {
  CellRectangle known{map.num_x, map.num_y, 0, 0};
  for (int y = 0; y < map.num_y; ++y) {
    for (int x = 0; x < map.num_x; ++x) {
      if (map.at(x, y) == Occupancy::kUnknown) continue;
      known = {std::min(known.x0, x), std::min(known.y0, y), std::max(known.x1, x + 1),
               std::max(known.y1, y + 1)};
    }
  }
  return {known.x0 - 1, known.y0 - 1, known.x1 + 1, known.y1 + 1};
}

/// Whether a cell is an obstacle; beyond the map's edge nothing is known.
bool IsObstacle(const OccupancyMap& map, UnknownCells unknown, int x, int y) {
  const bool is_inside = x >= 0 && y >= 0 && x < map.num_x && y < map.num_y;
  const Occupancy occupancy = is_inside ? map.at(x, y) : Occupancy::kUnknown;
  return occupancy == Occupancy::kOccupied ||
         (occupancy == Occupancy::kUnknown && unknown == UnknownCells::kOccupied);
}

/// Cells of `area` that are obstacles and in no rectangle yet.
class OpenCells {
 public:
  OpenCells(const OccupancyMap& map, UnknownCells unknown, const CellRectangle& area)
      : area_(area) {
    for (int y = area.y0; y < area.y1; ++y) {
      for (int x = area.x0; x < area.x1; ++x) cells_.push_back(IsObstacle(map, unknown, x, y));
    }
  }

  /// Takes rectangles of open cells until none is left. Each begins at the lowest leftmost cell and
  /// grows along one axis first, then along the other: the larger of the two ways is taken.
  std::vector<CellRectangle> TakeRectangles() {
    std::vector<CellRectangle> taken;
    for (int y = area_.y0; y < area_.y1; ++y) {
      for (int x = area_.x0; x < area_.x1; ++x) {
        const CellRectangle cell{x, y, x + 1, y + 1};
        if (!AreOpen(cell)) continue;
        const CellRectangle wide = GrowUp(GrowRight(cell));
        const CellRectangle tall = GrowRight(GrowUp(cell));
        const auto size = [](const CellRectangle& r) {
          return static_cast<std::int64_t>(r.x1 - r.x0) * (r.y1 - r.y0);
        };
        taken.push_back(size(wide) >= size(tall) ? wide : tall);
        Take(taken.back());
      }
    }
    return taken;
  }

 private:
  std::size_t Index(int x, int y) const {
    return static_cast<std::size_t>(y - area_.y0) * static_cast<std::size_t>(area_.x1 - area_.x0) +
           static_cast<std::size_t>(x - area_.x0);
  }

  bool AreOpen(const CellRectangle& r) const {
    for (int y = r.y0; y < r.y1; ++y) {
      for (int x = r.x0; x < r.x1; ++x) {
        if (cells_[Index(x, y)] == 0) return false;
      }
    }
    return true;
  }

  CellRectangle GrowRight(CellRectangle r) const {
    while (r.x1 < area_.x1 && AreOpen({r.x1, r.y0, r.x1 + 1, r.y1})) ++r.x1;
    return r;
  }

  CellRectangle GrowUp(CellRectangle r) const {
    while (r.y1 < area_.y1 && AreOpen({r.x0, r.y1, r.x1, r.y1 + 1})) ++r.y1;
    return r;
  }

  void Take(const CellRectangle& r) {
    for (int y = r.y0; y < r.y1; ++y) {
      for (int x = r.x0; x < r.x1; ++x) cells_[Index(x, y)] = 0;
    }
  }

  const CellRectangle area_;
  std::vector<std::uint8_t> cells_;  // Row by row from (x0, y0).
};

Box BoxOf(const OccupancyMap& map, const CellRectangle& r) {
  const double half = 0.5 * map.resolution;
  return {{base::Transform(map.X_WM, {half * (r.x0 + r.x1), half * (r.y0 + r.y1)}), map.X_WM.yaw},
          {half * (r.x1 - r.x0), half * (r.y1 - r.y0)}};
}

/// Refuses a start or goal that is outside the map or in an obstacle.
void RequireFree(const OccupancyMap& map, UnknownCells unknown, std::string_view what,
                 base::Vec2 p_W, const std::filesystem::path& path) {
  const base::Vec2 p_M = base::InverseTransform(map.X_WM, p_W);
  const double x = std::floor(p_M.x / map.resolution);
  const double y = std::floor(p_M.y / map.resolution);
  if (!(x >= 0.0 && y >= 0.0 && x < map.num_x && y < map.num_y)) {
    const Box all = BoxOf(map, {0, 0, map.num_x, map.num_y});
    const Bounds bounds = Including({all.X_WB.p, all.X_WB.p}, all);
    throw base::Error(
        "{}: the {} ({}, {}) is outside the map, expected x from {} to {} and y from {} to {}{}",
        path.string(), what, p_W.x, p_W.y, bounds.min_W.x, bounds.max_W.x, bounds.min_W.y,
        bounds.max_W.y, map.X_WM.yaw == 0.0 ? "" : ", less the corners of the turned map");
  }
  const int column = static_cast<int>(x);
  const int row = static_cast<int>(y);
  if (IsObstacle(map, unknown, column, row)) {
    const bool is_unknown = map.at(column, row) == Occupancy::kUnknown;
    throw base::Error(
        "{}: the {} ({}, {}) is in {}, expected a free one (the pixel in column {} and line {} of "
        "the image, counted from 1)",
        path.string(), what, p_W.x, p_W.y,
        is_unknown ? "an unknown cell, which counts as occupied" : "an occupied cell", column + 1,
        map.num_y - row);
  }
}

void RequireSolvable(const Course& course, const std::filesystem::path& path) {
  const auto [low, high] = course.bounds;
  const double farthest =
      std::max({std::abs(low.x), std::abs(low.y), std::abs(high.x), std::abs(high.y)});
  base::ThrowIf(farthest > 1e5, "{}: has coordinates up to {:g} m, expected at most 1e5",
                path.string(), farthest);
  if (const auto reason = WhyUnsolvable(course)) {
    throw base::Error("{}: cannot be driven: {}", path.string(), *reason);
  }
}

}  // namespace

ImportedCourse ImportWorld(std::string name, const std::filesystem::path& path,
                           const base::Pose2& start, base::Vec2 goal_W) {
  World world = ReadWorld(path);
  if (!world.moving_model_lines.empty()) {
    throw base::Error(
        "{}:{}: a plugin drives this model, and the file does not say how it moves, expected "
        "static models",
        path.string(), world.moving_model_lines.front());
  }
  ImportedCourse imported;
  if (world.has_damaged_end) {
    imported.remarks.push_back("the file does not end in </sdf> and was read as if it did");
  }
  if (world.num_out_of_reach > 0) {
    imported.remarks.push_back(
        fmt::format("{} shapes are left out, because the robot drives over or under them",
                    world.num_out_of_reach));
  }
  if (world.circles.empty() && world.boxes.empty()) {
    imported.remarks.push_back("the world has no obstacle");
  }
  Course& course = imported.course;
  course.name = std::move(name);
  course.start = start;
  course.goal_W = goal_W;
  course.circles = std::move(world.circles);
  course.boxes = std::move(world.boxes);
  course.bounds = {start.p, start.p};
  course.bounds = Including(course.bounds, Circle{goal_W, 0.0});
  for (const Circle& circle : course.circles) course.bounds = Including(course.bounds, circle);
  for (const Box& box : course.boxes) course.bounds = Including(course.bounds, box);
  const base::Vec2 margin{kWorldMargin, kWorldMargin};
  course.bounds = {course.bounds.min_W - margin, course.bounds.max_W + margin};
  RequireSolvable(course, path);
  return imported;
}

ImportedCourse ImportMap(std::string name, const std::filesystem::path& path,
                         const base::Pose2& start, base::Vec2 goal_W, UnknownCells unknown) {
  const OccupancyMap map = ReadMap(path);
  RequireFree(map, unknown, "start", start.p, path);
  RequireFree(map, unknown, "goal", goal_W, path);
  ImportedCourse imported;
  Course& course = imported.course;
  course.name = std::move(name);
  course.start = start;
  course.goal_W = goal_W;
  const CellRectangle area = unknown == UnknownCells::kOccupied
                                 ? KnownCells(map)
                                 : CellRectangle{0, 0, map.num_x, map.num_y};
  const Box all = BoxOf(map, area);
  course.bounds = Including({all.X_WB.p, all.X_WB.p}, all);
  for (const CellRectangle& r : OpenCells(map, unknown, area).TakeRectangles()) {
    course.boxes.push_back(BoxOf(map, r));
  }
  const auto num_unknown = std::ranges::count(map.cells, Occupancy::kUnknown);
  imported.remarks.push_back(fmt::format(
      "{} of {} cells are unknown; they and all beyond the map's edge count as {}", num_unknown,
      map.cells.size(), unknown == UnknownCells::kOccupied ? "occupied" : "free"));
  RequireSolvable(course, path);
  return imported;
}

}  // namespace slalom::sim
