#include "sim/courses/course_generator.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <utility>

#include "base/check.h"
#include "sim/courses/course_path.h"
#include "sim/courses/numbered_courses.h"

namespace slalom::sim {
namespace {

/// For each of 32 columns, a count from 0 to 15 in four bit planes.
class ColumnCounts {
 public:
  /// Adds 1 in the columns whose bit is set.
  void Add(std::uint32_t bits) {
    for (std::uint32_t& plane : planes_) {
      const std::uint32_t carry = plane & bits;
      plane ^= bits;
      bits = carry;
    }
  }

  std::uint32_t AtLeastFive() const {
    return planes_[3] | (planes_[2] & (planes_[1] | planes_[0]));
  }
  std::uint32_t AtMostOne() const { return ~(planes_[3] | planes_[2] | planes_[1]); }

 private:
  std::array<std::uint32_t, 4> planes_{};
};

/// One pass of the automaton: 5 or more of 8 neighbours filled -> filled, 1 or none -> free, else
/// as it was.
FieldGrid Smooth(const FieldGrid& field) {
  FieldGrid smoothed;
  for (int row = 0; row < kFieldSize; ++row) {
    ColumnCounts counts;
    for (const int other : {row - 1, row, row + 1}) {
      if (other < 0 || other >= kFieldSize) {
        // Beyond the side walls all counts as filled, at the corners of the field too.
        for (int i = 0; i < 3; ++i) counts.Add(FieldGrid::kFullRow);
        continue;
      }
      // Beyond the two open ends, where zeros are shifted in, all counts as free.
      counts.Add(field.row(other) << 1);
      counts.Add(field.row(other) >> 1);
      if (other != row) counts.Add(field.row(other));
    }
    smoothed.set_row(row, (field.row(row) & ~counts.AtMostOne()) | counts.AtLeastFive());
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
    if (is_wall) {
      field.set_row(row, FieldGrid::kFullRow);
      continue;
    }
    std::uint32_t bits = 0;
    for (int col = 0; col < kFieldSize; ++col) {
      bits |= (random.Uniform() < recipe.fill_probability ? 1u : 0u) << col;
    }
    field.set_row(row, bits);
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
  return MakeNumberedCourses(
      "static", seed, first, count, [](std::string name, int i, std::uint64_t own) {
        return GenerateCourse(std::move(name), PublishedRecipe(i / kCoursesPerRecipe % kNumRecipes),
                              own);
      });
}

CourseSet GenerateFreshCourses(std::uint64_t seed, int count) {
  return MakeNumberedCourses(
      "fresh", seed, 0, count, [](std::string name, int i, std::uint64_t own) {
        return GenerateCourse(std::move(name), PublishedRecipe(i % kNumRecipes), own);
      });
}

}  // namespace slalom::sim
