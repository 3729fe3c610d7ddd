#include "sim/courses/barn_importer.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>
#include <system_error>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "base/split.h"
#include "sim/courses/barn_field.h"
#include "sim/courses/course_check.h"
#include "sim/courses/course_difficulty.h"
#include "sim/courses/course_file.h"
#include "sim/courses/course_splits.h"
#include "sim/courses/dynamic_importer.h"

namespace slalom::sim {
namespace {

namespace fs = std::filesystem;

/// Sites that publish the data: of Perille et al. 2020, and of Xu et al. with the obstacles that
/// move.
constexpr std::string_view kDataSetUrl = "https://www.cs.utexas.edu/~xiao/BARN/BARN.html";
constexpr std::string_view kRepositoryUrl = "https://github.com/Daffan/ros_jackal";

/// The N of "world_N.world".
std::optional<int> WorldNumber(const fs::path& path) {
  const std::string name = path.filename().string();
  constexpr std::string_view kPrefix = "world_";
  constexpr std::string_view kSuffix = ".world";
  if (!name.starts_with(kPrefix) || !name.ends_with(kSuffix)) return std::nullopt;
  const std::size_t size = name.size() - kPrefix.size() - kSuffix.size();
  const auto number = base::ParseNumber<int>(std::string_view(name).substr(kPrefix.size(), size));
  return number >= 0 ? number : std::nullopt;
}

/// The files of a directory called world_N.world by their N, and the other worlds.
struct WorldFiles {
  std::map<int, fs::path> numbered;
  std::vector<std::string> others;
};

WorldFiles ListWorlds(const fs::path& directory) {
  std::error_code error;
  fs::directory_iterator entries(directory, error);
  if (error) throw base::Error("{}: cannot be listed: {}", directory.string(), error.message());
  WorldFiles files;
  for (const fs::directory_entry& entry : entries) {
    if (const auto number = WorldNumber(entry.path())) {
      if (!files.numbered.emplace(*number, entry.path()).second) {
        throw base::Error("{}: is world {} a second time, expected one file of it",
                          entry.path().string(), *number);
      }
    } else if (entry.path().extension() == ".world") {
      files.others.push_back(entry.path().filename().string());
    }
  }
  std::ranges::sort(files.others);
  return files;
}

/// `worlds`: the directory of the files world_N.world.
std::optional<fs::path> FindPathFile(const fs::path& worlds, int number) {
  const std::string name = fmt::format("path_{}.npy", number);
  for (const fs::path& path :
       {worlds / "path_files" / name, worlds / name, worlds / ".." / "path_files" / name}) {
    std::error_code error;
    if (fs::exists(path, error)) return path;
  }
  return std::nullopt;
}

/// The directory of the files world_N.world: `directory` itself or, as in the data set of Perille
/// et al., its world_files/.
fs::path WorldsIn(const fs::path& directory) {
  const fs::path inside = directory / "world_files";
  std::error_code error;
  return fs::is_directory(inside, error) && ListWorlds(directory).numbered.empty() ? inside
                                                                                   : directory;
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
  base::ThrowIf(path.num_cols != 2 || path.num_rows < 2,
                "{}: its path is a table of {} x {}, expected n x 2 with n >= 2", source,
                path.num_rows, path.num_cols);
  std::vector<Cell> cells;
  for (std::size_t i = 0; i < path.num_rows; ++i) {
    const Cell cell{static_cast<int>(std::clamp<std::int64_t>(path.at(i, 0), -1, kFieldSize)),
                    static_cast<int>(std::clamp<std::int64_t>(path.at(i, 1), -1, kFieldSize))};
    if (!IsInField(cell)) {
      throw base::Error("{}: its path leaves the field at cell {} ({}, {})", source, i,
                        path.at(i, 0), path.at(i, 1));
    }
    cells.push_back(cell);
  }
  return cells;
}

/// The field's obstacles. Empty if not all of the world lies on the lattice.
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
  for (const Circle& circle : world.circles) {
    if (!CellAt(circle.p_W)) bounds = Including(bounds, circle);
  }
  for (const Box& box : world.boxes) bounds = Including(bounds, box);
  return bounds;
}

/// The course of world `number` with the motions of its kind; `world` is null if it is not there.
Course MakeMovingCourse(const DynamicMotions& motions, int number, const World* world,
                        const fs::path& world_path) {
  const std::vector<MovingObstacle>& moving = motions.worlds.at(number);
  if (world != nullptr && world->moving_model_lines.size() != moving.size()) {
    throw base::Error("{}: has {} moving obstacles, but {} has {} for world {}",
                      world_path.string(), world->moving_model_lines.size(), motions.file.string(),
                      moving.size(), number);
  }
  const FixedObstacles fixed =
      world != nullptr ? FixedObstacles{world->circles, world->boxes} : motions.fixed.value();
  const char* kind = motions.kind == CourseKind::kDynamicBox ? "box" : "wall";
  return MakeDynamicCourse(fmt::format("barn-{}-{:03}", kind, number), motions.kind, fixed, moving,
                           world != nullptr ? world_path.string() : motions.file.string());
}

constexpr CourseKind kKinds[] = {CourseKind::kStatic, CourseKind::kDynamicBox,
                                 CourseKind::kDynamicWall};

/// The kind of the courses that world `number` is one of, nothing if the data set has no such
/// world.
std::optional<CourseKind> KindOf(int number) {
  for (const CourseKind kind : kKinds) {
    if (number >= FirstWorld(kind) && number < FirstWorld(kind) + NumCourses(kind)) return kind;
  }
  return std::nullopt;
}

/// Numbers of the worlds that the import remarks on.
struct Remarks {
  std::vector<int> mended, out_of_reach, without_obstacle, without_path, without_motion,
      without_fixed;
};

void Describe(const Remarks& remarks, BarnImport& import) {
  const auto add = [](std::vector<std::string>& to, const std::vector<int>& numbers,
                      std::string_view what) {
    if (numbers.empty()) return;
    to.push_back(fmt::format("{}: {} ({} in all)", what, ListNumbers(numbers), numbers.size()));
  };
  add(import.warnings, remarks.mended,
      "world files that do not end in </sdf>, as they should, were read as if they did");
  add(import.warnings, remarks.out_of_reach,
      "worlds have shapes that the robot drives over or under, which are left out");
  add(import.warnings, remarks.without_obstacle, "worlds have no obstacle");
  add(import.warnings, remarks.without_path, "worlds without a path_N.npy have no reference path");
  add(import.skipped, remarks.without_motion,
      "worlds with moving obstacles, whose motion is not in the world files but in compiled "
      "plugins, and not in dynamic_box.csv or dynamic_wall.csv either (docs/courses.md says what "
      "these hold and where it comes from)");
  add(import.skipped, remarks.without_fixed,
      "motions without a world file or dynamic_box_fixed.csv or dynamic_wall_fixed.csv, which "
      "would say what stands fixed");
}

}  // namespace

Course MakeImportedCourse(std::string name, const World& world, const IntegerTable* path,
                          const std::string& source) {
  SLALOM_CHECK(world.moving_model_lines.empty());
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
    throw base::Error("{}: cannot be driven: {}", source, *reason);
  }
  return course;
}

BarnImport ImportBarn(const fs::path& directory, const std::optional<fs::path>& motions) {
  const std::vector<DynamicMotions> all_motions = ReadMotions(motions.value_or(directory));
  if (motions && all_motions.empty()) {
    throw base::Error(
        "{}: holds neither dynamic_box.csv nor dynamic_wall.csv; docs/courses.md says what they "
        "hold and where it comes from",
        motions->string());
  }
  const fs::path worlds_directory = WorldsIn(directory);
  const auto [worlds, others] = ListWorlds(worlds_directory);
  base::ThrowIf(
      worlds.empty() && all_motions.empty(),
      "{}: holds no world_N.world file, nor does its world_files/; expected the directory of the "
      "original worlds: jackal_helper/worlds/BARN of {}, or the data set of {}",
      directory.string(), kRepositoryUrl, kDataSetUrl);
  BarnImport import;
  import.directory = directory;
  if (!others.empty()) {
    import.skipped.push_back(
        fmt::format("worlds that are not called world_N.world: {}", fmt::join(others, ", ")));
  }
  Remarks remarks;
  const auto motions_of = [&](int number) -> const DynamicMotions* {
    const auto found =
        std::find_if(all_motions.begin(), all_motions.end(),
                     [number](const DynamicMotions& m) { return m.worlds.contains(number); });
    return found == all_motions.end() ? nullptr : &*found;
  };
  for (const auto& [number, world_path] : worlds) {
    const auto kind = KindOf(number);
    if (!kind) {
      throw base::Error(
          "{}: the data set has worlds 0 to {}; to import a world of your own, give its file",
          world_path.string(), FirstWorld(kKinds[2]) + NumCourses(kKinds[2]) - 1);
    }
    const World world = ReadWorld(world_path);
    if (kind != CourseKind::kStatic && world.moving_model_lines.empty()) {
      throw base::Error("{}: nothing moves in it, expected moving obstacles in a world of {}",
                        world_path.string(), ToString(*kind));
    }
    if (world.has_damaged_end) remarks.mended.push_back(number);
    if (world.num_out_of_reach > 0) remarks.out_of_reach.push_back(number);
    if (!world.moving_model_lines.empty()) {
      if (const DynamicMotions* found = motions_of(number)) {
        import.courses[number] =
            std::make_shared<const Course>(MakeMovingCourse(*found, number, &world, world_path));
      } else {
        remarks.without_motion.push_back(number);
      }
      continue;
    }
    if (world.circles.empty() && world.boxes.empty()) remarks.without_obstacle.push_back(number);
    std::optional<IntegerTable> path;
    if (const auto path_file = FindPathFile(worlds_directory, number)) {
      path = ReadNpy(*path_file);
    } else {
      remarks.without_path.push_back(number);
    }
    import.courses[number] = std::make_shared<const Course>(MakeImportedCourse(
        fmt::format("barn-{:03}", number), world, path ? &*path : nullptr, world_path.string()));
  }
  for (const DynamicMotions& of_kind : all_motions) {
    for (const auto& [number, moving] : of_kind.worlds) {
      if (worlds.contains(number)) continue;
      if (of_kind.fixed) {
        import.courses[number] =
            std::make_shared<const Course>(MakeMovingCourse(of_kind, number, nullptr, {}));
      } else {
        remarks.without_fixed.push_back(number);
      }
    }
  }
  Describe(remarks, import);
  return import;
}

WrittenCollection WriteCollection(const BarnImport& import, const fs::path& output,
                                  IncompleteKinds incomplete) {
  base::ThrowIf(import.courses.empty(), "{}: there is no course to write", output.string());
  struct PartOfKind {
    CourseSet set;
    std::string missing;
  };
  std::vector<PartOfKind> parts;
  for (const CourseKind kind : kKinds) {
    CourseSet set;
    std::vector<int> missing;
    for (int number = FirstWorld(kind); KindOf(number) == kind; ++number) {
      const auto found = import.courses.find(number);
      if (found == import.courses.end()) {
        missing.push_back(number);
      } else {
        set.courses.push_back(found->second);
      }
    }
    if (missing.empty() || set.courses.empty()) continue;
    set.name = fmt::format("{}-{}-of-{}", ToString(kind), set.courses.size(), NumCourses(kind));
    parts.push_back(
        {std::move(set), fmt::format("{} of the {} worlds of {} are missing: {}", missing.size(),
                                     NumCourses(kind), ToString(kind), ListNumbers(missing))});
  }
  if (incomplete == IncompleteKinds::kRefuse && !parts.empty()) {
    std::string missing, names;
    for (const PartOfKind& part : parts) {
      missing += part.missing + "; ";
      names += (names.empty() ? "" : ", ") + part.set.name;
    }
    throw base::Error(
        "{}: {}expected all worlds of a kind or none. --incomplete writes those that are there as "
        "{}; to import a world of your own, give its file",
        import.directory.string(), missing, names);
  }
  base::MakeDirectories(output);
  WrittenCollection written;
  const auto write = [&](const CourseSet& set, std::string_view remark) {
    WriteCourseSet(output / fmt::format("{}{}", set.name, kCourseSetExtension), set, remark);
    written.sets.push_back(set.name);
  };
  for (const PartOfKind& part : parts) write(part.set, part.missing);
  for (const std::string_view name : SplitNames()) {
    const CourseSplit split = FindSplit(name).value();
    CourseSet set{std::string(name), {}};
    for (const int index : split.indices) {
      const auto found = import.courses.find(FirstWorld(split.kind) + index);
      if (found != import.courses.end()) set.courses.push_back(found->second);
    }
    if (set.courses.size() == split.indices.size()) {
      write(set, "");
    } else {
      written.incomplete.emplace_back(name);
    }
  }
  return written;
}

}  // namespace slalom::sim
