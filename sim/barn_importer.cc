#include "sim/barn_importer.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <system_error>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "sim/barn_field.h"
#include "sim/course_check.h"
#include "sim/course_difficulty.h"
#include "sim/course_file.h"
#include "sim/course_splits.h"

namespace slalom::sim {
namespace {

namespace fs = std::filesystem;

/// The N of "world_N.world".
std::optional<int> WorldNumber(const fs::path& path) {
  const std::string name = path.filename().string();
  constexpr std::string_view kPrefix = "world_";
  constexpr std::string_view kSuffix = ".world";
  if (!name.starts_with(kPrefix) || !name.ends_with(kSuffix)) return std::nullopt;
  const char* begin = name.data() + kPrefix.size();
  const char* end = name.data() + name.size() - kSuffix.size();
  int number = 0;
  const auto [rest, error] = std::from_chars(begin, end, number);
  if (error != std::errc() || rest != end || number < 0) return std::nullopt;
  return number;
}

std::map<int, fs::path> ListWorlds(const fs::path& directory) {
  std::error_code error;
  fs::directory_iterator entries(directory, error);
  if (error) {
    throw base::Error(fmt::format("{}: cannot be listed: {}", directory.string(), error.message()));
  }
  std::map<int, fs::path> worlds;
  for (const fs::directory_entry& entry : entries) {
    if (const auto number = WorldNumber(entry.path())) worlds[*number] = entry.path();
  }
  if (worlds.empty()) {
    throw base::Error(fmt::format(
        "{}: holds no world_N.world file; expected the directory of the original worlds",
        directory.string()));
  }
  return worlds;
}

std::optional<fs::path> FindPathFile(const fs::path& directory, int number) {
  const std::string name = fmt::format("path_{}.npy", number);
  for (const fs::path& path : {directory / "path_files" / name, directory / name}) {
    if (fs::exists(path)) return path;
  }
  return std::nullopt;
}

/// "3, 300 to 399, 401".
std::string ListNumbers(const std::vector<int>& numbers) {
  std::string text;
  for (std::size_t i = 0; i < numbers.size();) {
    std::size_t last = i;
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    if (!text.empty()) text += ", ";
    text += last == i ? fmt::format("{}", numbers[i])
                      : fmt::format("{} to {}", numbers[i], numbers[last]);
    i = last + 1;
  }
  return text;
}

std::vector<Cell> ReadCells(const IntegerTable& path, const std::string& source) {
  if (path.num_cols != 2 || path.num_rows < 2) {
    throw base::Error(fmt::format("{}: its path is a table of {} x {}, expected n x 2 with n >= 2",
                                  source, path.num_rows, path.num_cols));
  }
  std::vector<Cell> cells;
  for (std::size_t i = 0; i < path.num_rows; ++i) {
    const Cell cell{static_cast<int>(std::clamp<std::int64_t>(path.at(i, 0), -1, kFieldSize)),
                    static_cast<int>(std::clamp<std::int64_t>(path.at(i, 1), -1, kFieldSize))};
    if (!IsInField(cell)) {
      throw base::Error(fmt::format("{}: its path leaves the field at cell {} ({}, {})", source, i,
                                    path.at(i, 0), path.at(i, 1)));
    }
    cells.push_back(cell);
  }
  return cells;
}

/// The field's obstacles. None: not all of the world lies on the lattice.
std::optional<FieldGrid> ReadField(const World& world) {
  if (!world.boxes.empty()) return std::nullopt;
  FieldGrid field;
  for (const Circle& circle : world.circles) {
    const auto cell = CellAt(circle.p_W);
    if (!cell || circle.radius != kCylinderRadius) return std::nullopt;
    if (cell->col >= 0) field.set_filled(*cell, true);
  }
  return field;
}

Bounds BoundsWith(const World& world) {
  Bounds bounds = BarnBounds();
  const auto add = [&bounds](base::Vec2 p_W, double reach) {
    bounds.min_W = {std::min(bounds.min_W.x, p_W.x - reach),
                    std::min(bounds.min_W.y, p_W.y - reach)};
    bounds.max_W = {std::max(bounds.max_W.x, p_W.x + reach),
                    std::max(bounds.max_W.y, p_W.y + reach)};
  };
  for (const Circle& circle : world.circles) {
    if (!CellAt(circle.p_W)) add(circle.p_W, circle.radius);
  }
  for (const Box& box : world.boxes) add(box.X_WB.p, base::Norm(box.half_size));
  return bounds;
}

}  // namespace

Course MakeImportedCourse(std::string name, const World& world, const IntegerTable* path,
                          const std::string& source) {
  SLALOM_CHECK_EQ(world.num_moving_models, 0);
  Course course;
  course.name = std::move(name);
  course.start = BarnStart();
  course.goal_W = BarnGoal();
  course.bounds = BoundsWith(world);
  course.circles = world.circles;
  course.boxes = world.boxes;
  if (path != nullptr) {
    const std::vector<Cell> cells = ReadCells(*path, source);
    for (const Cell& cell : cells) course.reference_path_W.push_back(CellCentre(cell));
    const auto field = ReadField(world);
    if (field && cells.front() != cells.back()) {
      course.difficulty = MeasureDifficulty(InflateByRobot(*field), cells);
    }
  }
  if (const auto reason = WhyUnsolvable(course)) {
    throw base::Error(fmt::format("{}: cannot be driven: {}", source, *reason));
  }
  return course;
}

BarnImport ImportBarn(const fs::path& directory) {
  BarnImport import;
  std::vector<int> mended, moving, without_path;
  for (const auto& [number, world_path] : ListWorlds(directory)) {
    const World world = ReadWorld(world_path);
    if (world.has_damaged_end) mended.push_back(number);
    if (world.num_moving_models > 0) {
      moving.push_back(number);
      continue;
    }
    std::optional<IntegerTable> path;
    if (const auto path_file = FindPathFile(directory, number)) {
      path = ReadNpy(*path_file);
    } else {
      without_path.push_back(number);
    }
    import.courses[number] = std::make_shared<const Course>(MakeImportedCourse(
        fmt::format("barn-{:03}", number), world, path ? &*path : nullptr, world_path.string()));
  }
  if (!mended.empty()) {
    import.warnings.push_back(
        fmt::format("world files that do not end in </sdf>, as they should, were read as if they "
                    "did: {} ({} in all)",
                    ListNumbers(mended), mended.size()));
  }
  if (!without_path.empty()) {
    import.warnings.push_back(
        fmt::format("worlds without a path_N.npy have no reference path: {} ({} in all)",
                    ListNumbers(without_path), without_path.size()));
  }
  if (!moving.empty()) {
    import.skipped.push_back(
        fmt::format("worlds with moving obstacles, whose motion is not in the world files but in "
                    "compiled plugins: "
                    "{} ({} in all)",
                    ListNumbers(moving), moving.size()));
  }
  return import;
}

WrittenCollection WriteCollection(const BarnImport& import, const fs::path& output) {
  if (import.courses.empty()) {
    throw base::Error(fmt::format("{}: there is no static course to write", output.string()));
  }
  base::MakeDirectories(output);
  WrittenCollection written;
  for (const std::string_view name : StaticSplitNames()) {
    CourseSet set{std::string(name), {}};
    bool is_complete = true;
    if (name == "static") {
      for (const auto& [number, course] : import.courses) set.courses.push_back(course);
    } else {
      for (const std::vector<int> numbers = *StaticSplit(name); const int number : numbers) {
        const auto found = import.courses.find(number);
        is_complete = is_complete && found != import.courses.end();
        if (is_complete) set.courses.push_back(found->second);
      }
    }
    if (!is_complete) {
      written.incomplete.emplace_back(name);
      continue;
    }
    WriteCourseSet(output / fmt::format("{}{}", name, kCourseSetExtension), set);
    written.sets.emplace_back(name);
  }
  return written;
}

}  // namespace slalom::sim
