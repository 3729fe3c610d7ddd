#include "sim/course_generator.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <memory>
#include <utility>

#include "base/check.h"
#include "sim/course_path.h"

namespace slalom::sim {
namespace {

// Off the field counts as filled beyond the side walls, as free at the two open ends.
int CountFilledNeighbours(const FieldGrid& field, Cell cell) {
  int count = 0;
  for (int row = cell.row - 1; row <= cell.row + 1; ++row) {
    for (int col = cell.col - 1; col <= cell.col + 1; ++col) {
      if (row < 0 || row >= kFieldSize) {
        ++count;
      } else if (col >= 0 && col < kFieldSize && !(Cell{row, col} == cell)) {
        count += field.filled({row, col});
      }
    }
  }
  return count;
}

FieldGrid Smooth(const FieldGrid& field) {
  FieldGrid smoothed = field;
  for (int row = 0; row < kFieldSize; ++row) {
    for (int col = 0; col < kFieldSize; ++col) {
      const int num_filled = CountFilledNeighbours(field, {row, col});
      if (num_filled >= 5) smoothed.set_filled({row, col}, true);
      if (num_filled <= 1) smoothed.set_filled({row, col}, false);
    }
  }
  return smoothed;
}

/// The 4-connected free region round `seed`.
std::vector<Cell> FreeRegion(const FieldGrid& blocked, Cell seed, FieldGrid& seen) {
  std::vector<Cell> region = {seed};
  seen.set_filled(seed, true);
  for (std::size_t next = 0; next < region.size(); ++next) {
    const Cell cell = region[next];
    for (const Cell& neighbour : {Cell{cell.row - 1, cell.col}, Cell{cell.row + 1, cell.col},
                                  Cell{cell.row, cell.col - 1}, Cell{cell.row, cell.col + 1}}) {
      if (!IsInField(neighbour) || blocked.filled(neighbour) || seen.filled(neighbour)) continue;
      seen.set_filled(neighbour, true);
      region.push_back(neighbour);
    }
  }
  return region;
}

/// The largest free region that touches column `col`; the first of equal ones.
std::vector<Cell> LargestRegionAt(const FieldGrid& blocked, int col) {
  FieldGrid seen;
  std::vector<Cell> largest;
  for (int row = 0; row < kFieldSize; ++row) {
    if (blocked.filled({row, col}) || seen.filled({row, col})) continue;
    std::vector<Cell> region = FreeRegion(blocked, {row, col}, seen);
    if (region.size() > largest.size()) largest = std::move(region);
  }
  return largest;
}

Cell DrawCellInColumn(const std::vector<Cell>& region, int col, base::Random& random) {
  std::vector<Cell> cells;
  std::copy_if(region.begin(), region.end(), std::back_inserter(cells),
               [col](const Cell& cell) { return cell.col == col; });
  std::sort(cells.begin(), cells.end(), [](Cell a, Cell b) { return a.row < b.row; });
  return cells[random.UniformInt(cells.size())];
}

}  // namespace

FieldRecipe PublishedRecipe(int i) {
  SLALOM_CHECK_GE(i, 0);
  SLALOM_CHECK_LT(i, kNumRecipes);
  constexpr std::array kFillProbabilities = {0.15, 0.20, 0.25, 0.30};
  return {kFillProbabilities[static_cast<std::size_t>(i / 3)], 2 + i % 3};
}

FieldGrid DrawField(const FieldRecipe& recipe, base::Random& random) {
  FieldGrid field;
  for (int row = 0; row < kFieldSize; ++row) {
    const bool is_wall = row == 0 || row == kFieldSize - 1;
    for (int col = 0; col < kFieldSize; ++col) {
      field.set_filled({row, col}, is_wall || random.Uniform() < recipe.fill_probability);
    }
  }
  for (int i = 0; i < recipe.num_smoothings; ++i) field = Smooth(field);
  return field;
}

std::optional<std::vector<Cell>> DrawPath(const FieldGrid& blocked, base::Random& random) {
  const std::vector<Cell> region = LargestRegionAt(blocked, 0);
  const std::vector<Cell> exit_region = LargestRegionAt(blocked, kFieldSize - 1);
  if (region.empty() || exit_region.empty()) return std::nullopt;
  if (std::find(region.begin(), region.end(), exit_region.front()) == region.end()) {
    return std::nullopt;
  }
  const Cell entry = DrawCellInColumn(region, 0, random);
  const Cell exit = DrawCellInColumn(region, kFieldSize - 1, random);
  return FindPath(blocked, entry, exit);
}

Course GenerateCourse(std::string name, const FieldRecipe& recipe, std::uint64_t seed) {
  base::Random random(seed);
  while (true) {
    const FieldGrid field = DrawField(recipe, random);
    const auto path = DrawPath(InflateByRobot(field), random);
    if (path) return MakeBarnCourse(std::move(name), field, *path);
  }
}

CourseSet GenerateStaticCourses(std::uint64_t seed, int first, int count) {
  SLALOM_CHECK_GE(first, 0);
  SLALOM_CHECK_GE(count, 0);
  CourseSet set{fmt::format("static-{}", seed), {}};
  for (int i = first; i < first + count; ++i) {
    set.courses.push_back(std::make_shared<const Course>(GenerateCourse(
        fmt::format("static-{}-{:03}", seed, i),
        PublishedRecipe(i / kCoursesPerRecipe % kNumRecipes),
        base::DeriveSeed(seed, "static-course", {static_cast<std::uint64_t>(i)}))));
  }
  return set;
}

CourseSet GenerateFreshCourses(std::uint64_t seed, int count) {
  SLALOM_CHECK_GE(count, 0);
  CourseSet set{fmt::format("fresh-{}", seed), {}};
  for (int i = 0; i < count; ++i) {
    set.courses.push_back(std::make_shared<const Course>(
        GenerateCourse(fmt::format("fresh-{}-{:03}", seed, i), PublishedRecipe(i % kNumRecipes),
                       base::DeriveSeed(seed, "fresh-course", {static_cast<std::uint64_t>(i)}))));
  }
  return set;
}

}  // namespace slalom::sim
