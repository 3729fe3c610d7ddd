#include "sim/courses/course_generator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <vector>

#include "base/file.h"
#include "sim/courses/course_file.h"
#include "tests/sim/courses/barn_data.h"

namespace slalom::sim {
namespace {

using NaiveGrid = std::array<std::array<int, kFieldSize>, kFieldSize>;

/// The automaton in the words of docs/original-system.md, section 7.1, cell by cell.
NaiveGrid DrawNaively(const FieldRecipe& recipe, base::Random& random) {
  NaiveGrid grid{};
  for (int row = 0; row < kFieldSize; ++row) {
    for (int col = 0; col < kFieldSize; ++col) {
      const bool is_wall = row == 0 || row == kFieldSize - 1;
      grid[row][col] = is_wall || random.Uniform() < recipe.fill_probability;
    }
  }
  for (int pass = 0; pass < recipe.num_smoothings; ++pass) {
    NaiveGrid next = grid;
    for (int row = 0; row < kFieldSize; ++row) {
      for (int col = 0; col < kFieldSize; ++col) {
        int filled = 0;
        for (int r = row - 1; r <= row + 1; ++r) {
          for (int c = col - 1; c <= col + 1; ++c) {
            if (r == row && c == col) continue;
            if (r < 0 || r >= kFieldSize) {
              ++filled;
            } else if (c >= 0 && c < kFieldSize) {
              filled += grid[r][c];
            }
          }
        }
        if (filled >= 5) next[row][col] = 1;
        if (filled <= 1) next[row][col] = 0;
      }
    }
    grid = next;
  }
  return grid;
}

/// The cells where the 5 x 5 block round a cell holds a cylinder of the course.
NaiveGrid BlockedCells(const Course& course) {
  NaiveGrid blocked{};
  for (const Circle& circle : course.circles) {
    const long row = std::lround((circle.p_W.x + 4.425) / 0.15);
    const long col = std::lround((circle.p_W.y - 5.175) / 0.15);
    for (long r = row - 2; r <= row + 2; ++r) {
      for (long c = col - 2; c <= col + 2; ++c) {
        if (r >= 0 && r < kFieldSize && c >= 0 && c < kFieldSize) blocked[r][c] = 1;
      }
    }
  }
  return blocked;
}

/// Whether free cells lead from `entry` in column 0 to column 29, by spreading until nothing
/// changes.
bool LeadsThrough(const NaiveGrid& blocked, int entry) {
  NaiveGrid reached{};
  reached[entry][0] = 1;
  for (bool changed = true; changed;) {
    changed = false;
    for (int row = 0; row < kFieldSize; ++row) {
      for (int col = 0; col < kFieldSize; ++col) {
        if (blocked[row][col] || reached[row][col]) continue;
        const bool is_beside_reached =
            (row > 0 && reached[row - 1][col]) || (row + 1 < kFieldSize && reached[row + 1][col]) ||
            (col > 0 && reached[row][col - 1]) || (col + 1 < kFieldSize && reached[row][col + 1]);
        if (is_beside_reached) reached[row][col] = changed = true;
      }
    }
  }
  return std::any_of(reached.begin(), reached.end(),
                     [](const auto& row) { return row[kFieldSize - 1] == 1; });
}

TEST(CourseGenerator, AutomatonIsThePublishedOne) {
  for (int recipe = 0; recipe < kNumRecipes; ++recipe) {
    base::Random random(recipe);
    base::Random naive_random(recipe);
    for (int draw = 0; draw < 20; ++draw) {
      const FieldGrid field = DrawField(PublishedRecipe(recipe), random);
      const NaiveGrid naive = DrawNaively(PublishedRecipe(recipe), naive_random);
      for (int row = 0; row < kFieldSize; ++row) {
        for (int col = 0; col < kFieldSize; ++col) {
          ASSERT_EQ(field.filled({row, col}), naive[row][col] == 1)
              << "recipe " << recipe << " draw " << draw << " cell " << row << ", " << col;
        }
      }
    }
  }
}

TEST(CourseGenerator, RecipesAreInPublishedOrder) {
  EXPECT_EQ(PublishedRecipe(0).fill_probability, 0.15);
  EXPECT_EQ(PublishedRecipe(0).num_smoothings, 2);
  EXPECT_EQ(PublishedRecipe(1).num_smoothings, 3);
  EXPECT_EQ(PublishedRecipe(3).fill_probability, 0.20);
  EXPECT_EQ(PublishedRecipe(11).fill_probability, 0.30);
  EXPECT_EQ(PublishedRecipe(11).num_smoothings, 4);
}

TEST(CourseGenerator, EveryCourseCanBeCrossedAlongItsPath) {
  for (const auto& course : GenerateStaticCourses(1, 0, kNumStaticCourses).courses) {
    SCOPED_TRACE(course->name);
    const NaiveGrid blocked = BlockedCells(*course);
    std::vector<Cell> path;
    for (const base::Vec2& p : course->reference_path_W) path.push_back(CellAt(p).value());
    ASSERT_GE(path.size(), 30u);
    EXPECT_EQ(path.front().col, 0);
    EXPECT_EQ(path.back().col, kFieldSize - 1);
    EXPECT_TRUE(LeadsThrough(blocked, path.front().row));
    Cell last_step{0, 0};
    for (std::size_t i = 0; i < path.size(); ++i) {
      EXPECT_EQ(blocked[path[i].row][path[i].col], 0);
      if (i == 0) continue;
      const Cell step{path[i].row - path[i - 1].row, path[i].col - path[i - 1].col};
      EXPECT_EQ(std::max(std::abs(step.row), std::abs(step.col)), 1);
      // Turns of at most 45 degrees: steps a right angle or more apart have a product of 0 or less.
      if (i > 1) EXPECT_GT(step.row * last_step.row + step.col * last_step.col, 0);
      last_step = step;
    }
  }
}

TEST(CourseGenerator, CourseHasPenFieldStartAndGoalOfThePaper) {
  const auto course = GenerateStaticCourses(3, 11, 1).courses.front();
  EXPECT_EQ(course->start, (base::Pose2{{-2.0, 3.0}, 1.57}));
  EXPECT_EQ(course->goal_W, (base::Vec2{-2.0, 13.0}));
  std::set<std::pair<double, double>> centres;
  for (const Circle& circle : course->circles) {
    EXPECT_EQ(circle.radius, 0.075);
    EXPECT_TRUE(centres.insert({circle.p_W.x, circle.p_W.y}).second);
  }
  for (int i = 0; i < 30; ++i) EXPECT_TRUE(centres.contains({(-4425 + 150 * i) / 1000.0, 0.075}));
  for (int i = 0; i < 64; ++i) {
    EXPECT_TRUE(centres.contains({-4.425, (75 + 150 * i) / 1000.0}));
    EXPECT_TRUE(centres.contains({-0.075, (75 + 150 * i) / 1000.0}));
  }
  EXPECT_TRUE(course->difficulty.has_value());
}

TEST(CourseGenerator, EnclosedCellsAreLeftOut) {
  FieldGrid field;
  for (int row = 10; row < 13; ++row) {
    for (int col = 10; col < 14; ++col) field.set_filled({row, col}, true);
  }
  const Course course = MakeBarnCourse("block", field, {});
  const auto has = [&](Cell cell) {
    return std::any_of(course.circles.begin(), course.circles.end(),
                       [&](const Circle& c) { return c.p_W == CellCentre(cell); });
  };
  EXPECT_TRUE(has({10, 10}));
  EXPECT_TRUE(has({11, 10}));
  EXPECT_FALSE(has({11, 11}));
  EXPECT_FALSE(has({11, 12}));
  EXPECT_TRUE(has({11, 13}));
}

TEST(CourseGenerator, CourseDependsOnSeedAndIndexAlone) {
  const CourseSet all = GenerateStaticCourses(5, 0, 40);
  const CourseSet some = GenerateStaticCourses(5, 30, 10);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(*all.courses[30 + i], *some.courses[i]);
  const auto circles = [](std::uint64_t seed, int index) {
    return GenerateStaticCourses(seed, index, 1).courses.front()->circles;
  };
  EXPECT_NE(circles(5, 0), circles(6, 0));
  EXPECT_NE(circles(5, 0), circles(5, 1));
  EXPECT_NE(circles(5, 0), circles(5, 300));
  EXPECT_NE(circles(5, 0), GenerateFreshCourses(5, 1).courses.front()->circles);
}

// The same bits in every build, on every machine, for good: results name courses by seed and index.
TEST(CourseGenerator, CoursesNeverChange) {
  const CourseSet set = GenerateStaticCourses(1, 250, 10);
  EXPECT_EQ(base::Checksum(PrintCourseSet(set)), 14469518779022506742ull);
}

/// Numbers of a collection whose distribution is compared with the original's.
struct Sample {
  std::vector<double> num_cylinders;
  std::vector<double> lengths;
};

double Mean(const std::vector<double>& v) {
  double sum = 0.0;
  for (const double x : v) sum += x;
  return sum / static_cast<double>(v.size());
}

double Variance(const std::vector<double>& v) {
  double sum = 0.0;
  for (const double x : v) sum += (x - Mean(v)) * (x - Mean(v));
  return sum / static_cast<double>(v.size() - 1);
}

Sample Generated(std::uint64_t seed) {
  Sample sample;
  for (const auto& course : GenerateStaticCourses(seed, 0, kNumStaticCourses).courses) {
    sample.num_cylinders.push_back(static_cast<double>(course->circles.size()));
    sample.lengths.push_back(ReferenceLength(*course));
  }
  return sample;
}

Sample Original(const std::vector<BarnWorld>& worlds) {
  Sample sample;
  for (const BarnWorld& world : worlds) {
    sample.num_cylinders.push_back(static_cast<double>(world.circles.size()));
    Course course;
    course.start = BarnStart();
    course.goal_W = BarnGoal();
    for (const Cell& cell : world.path) course.reference_path_W.push_back(CellCentre(cell));
    sample.lengths.push_back(ReferenceLength(course));
  }
  return sample;
}

TEST_F(PublishedWorlds, ResembleGeneratedOnes) {
  const Sample original = Original(ReadBarnWorlds(directory()));
  ASSERT_EQ(original.lengths.size(), 300u);
  const Sample generated = Generated(1);
  // Mean number of cylinders: within 4 standard errors of a difference of two means of 300.
  const double bound =
      4.0 *
      std::sqrt((Variance(original.num_cylinders) + Variance(generated.num_cylinders)) / 300.0);
  EXPECT_NEAR(Mean(generated.num_cylinders), Mean(original.num_cylinders), bound);
  // The whole distributions: Kolmogorov-Smirnov at level 1e-3, 1.95 * sqrt(2 / 300).
  EXPECT_LT(DistributionDistance(generated.num_cylinders, original.num_cylinders), 0.159);
  EXPECT_LT(DistributionDistance(generated.lengths, original.lengths), 0.159);
}

}  // namespace
}  // namespace slalom::sim
