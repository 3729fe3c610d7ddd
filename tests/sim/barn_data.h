#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "sim/barn_field.h"
#include "sim/course.h"

/// The original data set as plain text beside this repository (../shared/barn), for tests that
/// compare with it. Tests skip themselves, saying so, where it is absent.

namespace slalom::sim {

/// One static world of static_grids.txt and static_paths.csv.
struct BarnWorld {
  int number = 0;
  std::vector<Circle> circles;  ///< Unsorted.
  std::vector<Cell> path;
};

std::filesystem::path BarnDirectory();
bool HasBarnData();

/// All static worlds, by number. Requires: HasBarnData().
std::vector<BarnWorld> ReadBarnWorlds();

/// The moving obstacles of each world of dynamic_box.csv or dynamic_wall.csv, by world. Requires:
/// HasBarnData().
std::vector<std::vector<MovingObstacle>> ReadBarnMotions(const std::string& file);

}  // namespace slalom::sim
