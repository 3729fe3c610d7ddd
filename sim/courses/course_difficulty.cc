#include "sim/courses/course_difficulty.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "base/check.h"

namespace slalom::sim {
namespace {

constexpr std::array<Cell, 8> kRays = {
    {{-1, -1}, {-1, 0}, {-1, 1}, {0, -1}, {0, 1}, {1, -1}, {1, 0}, {1, 1}}};
constexpr std::array<Cell, 4> kAxes = {{{0, 1}, {1, 1}, {1, 0}, {1, -1}}};
// The 8 rays and one between each two, in angular order.
constexpr std::array<Cell, 16> kFan = {{{0, 1},
                                        {1, 2},
                                        {1, 1},
                                        {2, 1},
                                        {1, 0},
                                        {2, -1},
                                        {1, -1},
                                        {1, -2},
                                        {0, -1},
                                        {-1, -2},
                                        {-1, -1},
                                        {-2, -1},
                                        {-1, 0},
                                        {-2, 1},
                                        {-1, 1},
                                        {-1, 2}}};
constexpr int kDispersionRadius = 3;

Cell Step(Cell cell, Cell move) { return {cell.row + move.row, cell.col + move.col}; }

double Distance(Cell a, Cell b) {
  const int rows = a.row - b.row;
  const int cols = a.col - b.col;
  return std::sqrt(static_cast<double>(rows * rows + cols * cols));
}

/// Looks at ever larger squares round the cell, until no cell outside can be nearer.
double DistanceToObstacle(const PathGrid& grid, Cell cell) {
  const int largest = std::max(grid.num_rows(), grid.num_cols());
  int best = std::numeric_limits<int>::max();
  const auto look_at = [&](int rows, int cols) {
    const Cell other{cell.row + rows, cell.col + cols};
    if (grid.Holds(other) && grid.blocked(other)) best = std::min(best, rows * rows + cols * cols);
  };
  for (int reach = 0; reach < largest && reach * reach < best; ++reach) {
    for (int along = -reach; along <= reach; ++along) {
      look_at(-reach, along);
      look_at(reach, along);
      look_at(along, -reach);
      look_at(along, reach);
    }
  }
  // In a field without walls: the distance from the middle of the field to its sides.
  if (best == std::numeric_limits<int>::max()) {
    return 0.5 * (std::min(grid.num_rows(), grid.num_cols()) - 1);
  }
  return std::sqrt(static_cast<double>(best));
}

double Visibility(const PathGrid& grid, Cell cell) {
  int total = 0;
  int num_rays = 0;
  for (const Cell& ray : kRays) {
    int free = 0;
    Cell at = cell;
    while (grid.Holds(at) && !grid.blocked(at)) {
      ++free;
      at = Step(at, ray);
    }
    if (!grid.Holds(at)) continue;
    total += free;
    ++num_rays;
  }
  return num_rays == 0 ? 0.0 : static_cast<double>(total) / num_rays;
}

bool EndsNearby(const PathGrid& grid, Cell cell, Cell ray) {
  const int stride = std::max(std::abs(ray.row), std::abs(ray.col));
  for (int gone = 0; gone < kDispersionRadius; gone += stride) {
    cell = Step(cell, ray);
    if (!grid.Holds(cell)) return false;
    if (grid.blocked(cell)) return true;
  }
  return false;
}

int Dispersion(const PathGrid& grid, Cell cell) {
  int changes = 0;
  bool last = EndsNearby(grid, cell, kFan.back());
  for (const Cell& ray : kFan) {
    const bool ends = EndsNearby(grid, cell, ray);
    changes += ends != last;
    last = ends;
  }
  return changes;
}

double CharacteristicDimension(const PathGrid& grid, Cell cell) {
  double best = 2.0 * std::max(grid.num_rows(), grid.num_cols());
  for (const Cell& axis : kAxes) {
    int free = 0;
    for (const int way : {1, -1}) {
      const Cell move{way * axis.row, way * axis.col};
      for (Cell at = Step(cell, move); grid.Holds(at) && !grid.blocked(at); at = Step(at, move)) {
        ++free;
      }
    }
    best = std::min(best, free * Distance(axis, {0, 0}));
  }
  return best;
}

double Tortuosity(std::span<const Cell> path) {
  double length = 0.0;
  for (std::size_t i = 1; i < path.size(); ++i) length += Distance(path[i - 1], path[i]);
  return length / Distance(path.front(), path.back());
}

constexpr std::array kMeasures = {&Difficulty::distance_to_obstacle, &Difficulty::visibility,
                                  &Difficulty::dispersion, &Difficulty::characteristic_dimension,
                                  &Difficulty::tortuosity};

}  // namespace

Difficulty MeasureDifficulty(const PathGrid& blocked, std::span<const Cell> path) {
  SLALOM_CHECK_GE(path.size(), 2u);
  SLALOM_CHECK(path.front() != path.back());
  Difficulty sum;
  for (const Cell& cell : path) {
    sum.distance_to_obstacle += DistanceToObstacle(blocked, cell);
    sum.visibility += Visibility(blocked, cell);
    sum.dispersion += Dispersion(blocked, cell);
    sum.characteristic_dimension += CharacteristicDimension(blocked, cell);
  }
  const auto n = static_cast<double>(path.size());
  return {sum.distance_to_obstacle / n, sum.visibility / n, sum.dispersion / n,
          sum.characteristic_dimension / n, Tortuosity(path)};
}

Difficulty MeasureDifficulty(const FieldGrid& blocked, std::span<const Cell> path) {
  return MeasureDifficulty(PathGrid(blocked), path);
}

Difficulty Normalise(const Difficulty& difficulty, std::span<const Difficulty> all) {
  SLALOM_CHECK(!all.empty());
  Difficulty normal;
  for (const auto measure : kMeasures) {
    double mean = 0.0;
    for (const Difficulty& d : all) mean += d.*measure;
    mean /= static_cast<double>(all.size());
    double variance = 0.0;
    for (const Difficulty& d : all) variance += (d.*measure - mean) * (d.*measure - mean);
    variance /= static_cast<double>(all.size());
    normal.*measure = variance > 0.0 ? (difficulty.*measure - mean) / std::sqrt(variance) : 0.0;
  }
  return normal;
}

MotionMeasures MeasureMotion(const Course& course) {
  if (course.moving.empty()) return {};
  const base::Vec2 size = course.bounds.max_W - course.bounds.min_W;
  double speeds = 0.0;
  for (const MovingObstacle& obstacle : course.moving) {
    double way = 0.0;
    for (std::size_t i = 1; i < obstacle.key_frames.size(); ++i) {
      way += base::Norm(obstacle.key_frames[i].X_WB.p - obstacle.key_frames[i - 1].X_WB.p);
    }
    speeds += way / obstacle.key_frames.back().time;
  }
  const auto count = static_cast<double>(course.moving.size());
  return {.density = count / (size.x * size.y), .mean_speed = speeds / count};
}

}  // namespace slalom::sim
