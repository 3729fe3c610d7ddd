#include "sim/courses/dynamic_importer.h"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "base/split.h"
#include "sim/courses/barn_field.h"
#include "sim/courses/course_check.h"
#include "sim/courses/dynamic_generator.h"

namespace slalom::sim {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMotionColumns = "world,object,size_x,size_y,x0,y0,x1,y1,yaw,period_s";
constexpr std::string_view kBoxColumns = "name,size_x,size_y,x,y,yaw";
constexpr std::string_view kCylinderColumns = "x,y";

/// A file of comma-separated values under a line that names the columns. Every error names the
/// line.
class Table {
 public:
  /// Throws `Error` if the file cannot be read or has other columns.
  Table(const fs::path& path, std::string_view columns)
      : source_(path.string()),
        text_(base::ReadTextFile(path)),
        columns_(base::Split(columns, ',')) {
    const std::vector<std::string_view> lines = base::Split(text_, '\n');
    for (std::size_t i = 0; i < lines.size(); ++i) {
      std::string_view line = lines[i];
      if (line.ends_with('\r')) line.remove_suffix(1);
      line_numbers_.push_back(i + 1);
      if (i == 0) {
        rows_.push_back({});
        if (line != columns) Fail(0, fmt::format("expected the columns \"{}\"", columns));
      } else if (line.empty()) {
        line_numbers_.pop_back();
      } else {
        rows_.push_back(base::Split(line, ','));
        if (rows_.back().size() != columns_.size()) {
          Fail(rows_.size() - 1, fmt::format("found {} fields, expected {} ({})",
                                             rows_.back().size(), columns_.size(), columns));
        }
      }
    }
  }

  /// Rows are 1 to num_rows(); row 0 holds the names of the columns.
  std::size_t num_rows() const { return rows_.size() - 1; }
  std::string_view text(std::size_t row, std::size_t column) const { return rows_[row][column]; }

  double Number(std::size_t row, std::size_t column) const {
    const std::string_view field = text(row, column);
    const auto number = base::ParseNumber<double>(field);
    if (!number || !(std::abs(*number) <= 1e5)) {
      Fail(row, fmt::format("{} is \"{}\", expected a number between -1e5 and 1e5",
                            columns_[column], field));
    }
    return *number;
  }

  double PositiveNumber(std::size_t row, std::size_t column) const {
    const double number = Number(row, column);
    if (!(number > 0.0)) {
      Fail(row, fmt::format("{} is {}, expected above 0", columns_[column], text(row, column)));
    }
    return number;
  }

  [[noreturn]] void Fail(std::size_t row, const std::string& what) const {
    throw base::Error("{}:{}: {}", source_, line_numbers_[row], what);
  }

 private:
  const std::string source_;
  const std::string text_;
  const std::vector<std::string_view> columns_;
  std::vector<std::vector<std::string_view>> rows_;
  std::vector<std::size_t> line_numbers_;  // Line of each row.
};

int ReadWorldNumber(const Table& table, std::size_t row, CourseKind kind) {
  const int first = FirstWorld(kind);
  const int last = first + NumCourses(kind) - 1;
  const double number = table.Number(row, 0);
  if (number != std::floor(number) || number < first || number > last) {
    table.Fail(
        row, fmt::format("world is {}, expected one of {} to {}", table.text(row, 0), first, last));
  }
  return static_cast<int>(number);
}

std::map<int, std::vector<MovingObstacle>> ReadWorlds(const fs::path& path, CourseKind kind) {
  const Table table(path, kMotionColumns);
  std::map<int, std::vector<MovingObstacle>> worlds;
  std::set<std::pair<int, std::string_view>> objects;
  for (std::size_t row = 1; row <= table.num_rows(); ++row) {
    const int world = ReadWorldNumber(table, row, kind);
    if (!objects.insert({world, table.text(row, 1)}).second) {
      table.Fail(row, fmt::format("object {} of world {} stands here a second time",
                                  table.text(row, 1), world));
    }
    const base::Vec2 size = {table.PositiveNumber(row, 2), table.PositiveNumber(row, 3)};
    const base::Vec2 from = {table.Number(row, 4), table.Number(row, 5)};
    const base::Vec2 to = {table.Number(row, 6), table.Number(row, 7)};
    const double yaw = table.Number(row, 8);
    MovingObstacle obstacle =
        StraightLoop(size, {from, yaw}, {to, yaw}, table.PositiveNumber(row, 9));
    if (const auto why = WhyBadKeyFrame(obstacle, 1)) table.Fail(row, *why);
    worlds[world].push_back(std::move(obstacle));
  }
  base::ThrowIf(worlds.empty(), "{}: holds no motion", path.string());
  return worlds;
}

/// "dynamic_box_fixed.csv" names boxes, "dynamic_wall_fixed.csv" cylinders of the lattice.
FixedObstacles ReadFixed(const fs::path& path, CourseKind kind) {
  FixedObstacles fixed;
  if (kind == CourseKind::kDynamicBox) {
    const Table table(path, kBoxColumns);
    for (std::size_t row = 1; row <= table.num_rows(); ++row) {
      fixed.boxes.push_back(
          {{{table.Number(row, 3), table.Number(row, 4)}, table.Number(row, 5)},
           0.5 * base::Vec2{table.PositiveNumber(row, 1), table.PositiveNumber(row, 2)}});
    }
  } else {
    const Table table(path, kCylinderColumns);
    for (std::size_t row = 1; row <= table.num_rows(); ++row) {
      fixed.circles.push_back({{table.Number(row, 0), table.Number(row, 1)}, kCylinderRadius});
    }
  }
  return fixed;
}

}  // namespace

std::vector<DynamicMotions> ReadMotions(const fs::path& directory) {
  std::vector<DynamicMotions> all;
  for (const CourseKind kind : {CourseKind::kDynamicBox, CourseKind::kDynamicWall}) {
    const std::string stem = kind == CourseKind::kDynamicBox ? "dynamic_box" : "dynamic_wall";
    const fs::path file = directory / (stem + ".csv");
    std::error_code error;
    if (!fs::exists(file, error)) continue;
    DynamicMotions motions{kind, file, ReadWorlds(file, kind), std::nullopt};
    const fs::path fixed = directory / (stem + "_fixed.csv");
    if (fs::exists(fixed, error)) motions.fixed = ReadFixed(fixed, kind);
    all.push_back(std::move(motions));
  }
  return all;
}

Course MakeDynamicCourse(std::string name, CourseKind kind, const FixedObstacles& fixed,
                         const std::vector<MovingObstacle>& moving, const std::string& source) {
  SLALOM_CHECK(kind != CourseKind::kStatic);
  Course course = kind == CourseKind::kDynamicBox ? DynamicBoxArena(std::move(name))
                                                  : DynamicWallArena(std::move(name));
  course.circles = fixed.circles;
  course.boxes = fixed.boxes;
  course.moving = moving;
  for (const Circle& circle : course.circles) course.bounds = Including(course.bounds, circle);
  for (const Box& box : course.boxes) course.bounds = Including(course.bounds, box);
  for (const MovingObstacle& obstacle : moving) {
    for (const KeyFrame& frame : obstacle.key_frames) {
      course.bounds = Including(course.bounds, Box{frame.X_WB, obstacle.half_size});
    }
  }
  if (const auto reason = WhyUnsolvable(course)) {
    throw base::Error("{}: world of course {} cannot be driven: {}", source, course.name, *reason);
  }
  return course;
}

}  // namespace slalom::sim
