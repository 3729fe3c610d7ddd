#include "sim/courses/course_difficulty.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "sim/courses/course_generator.h"

namespace slalom::sim {
namespace {

/// Rows 0 to 9 and 21 to 29 blocked: a corridor of 11 rows, its middle row 15.
FieldGrid Corridor() {
  FieldGrid blocked;
  for (int row = 0; row < kFieldSize; ++row) {
    if (row <= 9 || row >= 21) blocked.set_row(row, FieldGrid::kFullRow);
  }
  return blocked;
}

TEST(CourseDifficulty, OfACorridorIsWhatPenAndPaperSay) {
  const std::vector<Cell> path = {{15, 14}, {15, 15}};
  const Difficulty d = MeasureDifficulty(Corridor(), path);
  EXPECT_DOUBLE_EQ(d.distance_to_obstacle, 6.0);
  // The two rays along the corridor leave the field and do not count; the other six see 6 free
  // cells each, the cell itself included.
  EXPECT_DOUBLE_EQ(d.visibility, 6.0);
  EXPECT_DOUBLE_EQ(d.dispersion, 0.0);
  // Across: 5 free cells on each side.
  EXPECT_DOUBLE_EQ(d.characteristic_dimension, 10.0);
  EXPECT_DOUBLE_EQ(d.tortuosity, 1.0);
}

TEST(CourseDifficulty, NearAnObstacleIsWhatPenAndPaperSay) {
  FieldGrid blocked = Corridor();
  blocked.set_filled({15, 17}, true);
  const std::vector<Cell> path = {{15, 15}, {14, 15}};
  const Difficulty d = MeasureDifficulty(blocked, path);
  // From (15, 15) 2 cells, from (14, 15) sqrt(1 + 4).
  EXPECT_DOUBLE_EQ(d.distance_to_obstacle, 0.5 * (2.0 + std::sqrt(5.0)));
  // (15, 15): six rays of 6 and one of 2. (14, 15): up 5 x 3 (rows 14 to 10), down 7 x 3 (rows 14
  // to 20).
  EXPECT_DOUBLE_EQ(d.visibility, 0.5 * ((6.0 * 6 + 2) / 7.0 + (5.0 * 3 + 7 * 3) / 6.0));
  // (15, 15): one ray of the fan ends at the obstacle within 3 cells. (14, 15): the ray (1, 2) hits
  // it.
  EXPECT_DOUBLE_EQ(d.dispersion, 2.0);
  // (15, 15): the axis along the corridor has 1 free cell on one side and 15 on the other; across
  // 10 in all.
  EXPECT_DOUBLE_EQ(d.characteristic_dimension, 10.0);
}

TEST(CourseDifficulty, TortuosityIsLengthOverDistance) {
  const std::vector<Cell> path = {{15, 10}, {16, 11}, {15, 12}};
  EXPECT_DOUBLE_EQ(MeasureDifficulty(Corridor(), path).tortuosity, std::sqrt(2.0));
}

TEST(CourseDifficulty, NormalisedHasMeanZeroAndDeviationOne) {
  std::vector<Difficulty> all;
  for (const auto& course : GenerateFreshCourses(3, 24).courses) all.push_back(*course->difficulty);
  double mean = 0.0;
  double square = 0.0;
  for (const Difficulty& d : all) {
    const double value = Normalise(d, all).visibility;
    mean += value / 24.0;
    square += value * value / 24.0;
  }
  EXPECT_NEAR(mean, 0.0, 1e-12);
  EXPECT_NEAR(square, 1.0, 1e-12);
  const std::vector<Difficulty> same(3, all[0]);
  EXPECT_EQ(Normalise(all[0], same), Difficulty{});
}

TEST(MeasureMotion, CountsFromTheKeyFrames) {
  Course course;
  course.bounds = {{-5.0, -2.0}, {5.0, 2.0}};  // 40 m^2.
  EXPECT_EQ(MeasureMotion(course).density, 0.0);
  MovingObstacle obstacle;
  obstacle.radius = 0.3;
  obstacle.key_frames = {{0.0, {{0.0, 0.0}, 0.0}}, {4.0, {{3.0, 4.0}, 0.0}}};
  course.moving.push_back(obstacle);  // 1.25 m/s.
  obstacle.key_frames.push_back({8.0, {{3.0, 4.0}, 1.0}});
  course.moving.push_back(obstacle);  // 0.625 m/s.
  EXPECT_DOUBLE_EQ(MeasureMotion(course).density, 0.05);
  EXPECT_DOUBLE_EQ(MeasureMotion(course).mean_speed, 0.9375);
}

}  // namespace
}  // namespace slalom::sim
