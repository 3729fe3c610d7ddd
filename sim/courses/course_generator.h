#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/random.h"
#include "sim/courses/barn_field.h"
#include "sim/courses/course.h"

/// The generator of the static BARN courses (Perille et al. 2020; docs/original-system.md,
/// section 7.1): a cellular automaton fills a 30 x 30 field, and fields that the robot cannot cross
/// are thrown away.

namespace slalom::sim {

/// How densely a field is filled at first, and how often it is then smoothed.
struct FieldRecipe {
  double fill_probability = 0.15;
  int num_smoothings = 2;
};

inline constexpr int kNumRecipes = 12;
inline constexpr int kCoursesPerRecipe = 25;
inline constexpr int kNumStaticCourses = kNumRecipes * kCoursesPerRecipe;

/// Recipe i of the published twelve: fill 0.15, 0.20, 0.25, 0.30, each with 2, 3 and 4 smoothings.
/// Requires: 0 <= i < kNumRecipes.
FieldRecipe PublishedRecipe(int i);

/// One draw of the cellular automaton, crossable or not. Rows 0 and 29 are solid side walls.
FieldGrid DrawField(const FieldRecipe& recipe, base::Random& random);

/// Draws a way for the robot through the field, as the original does. `blocked` comes from
/// `InflateByRobot`. Its largest 4-connected free region at column 0 must also be the largest at
/// column 29. An entry and an exit cell are drawn from that region, and `FindPath` joins them.
/// Returns nothing if the field cannot be crossed, or not with turns of at most 45 degrees.
std::optional<std::vector<Cell>> DrawPath(const FieldGrid& blocked, base::Random& random);

/// A solvable course of this recipe. The same arguments give the same course, bit for bit.
Course GenerateCourse(std::string name, const FieldRecipe& recipe, std::uint64_t seed);

/// Courses [first, first + count) of the collection of `seed`, named "static-SEED-INDEX".
///
/// Course i is a function of (seed, i) alone: it does not depend on which others are made. Courses
/// 0 to 299 follow the published scheme, recipe i / 25. Beyond them the scheme starts again, with
/// recipe (i / 25) % 12.
///
/// Requires: first >= 0, count >= 0. Cost: 0.7 ms a course on average, most of it for the crowded
/// recipes, where about one draw in 900 can be crossed.
CourseSet GenerateStaticCourses(std::uint64_t seed, int first, int count);

/// `count` courses named "fresh-SEED-INDEX". Course i has recipe i % 12, so that a set of any size
/// is balanced. None of them is in a collection of `GenerateStaticCourses`, whatever the seeds.
/// Requires: count >= 0.
CourseSet GenerateFreshCourses(std::uint64_t seed, int count);

}  // namespace slalom::sim
