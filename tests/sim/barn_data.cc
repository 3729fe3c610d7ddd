#include "tests/sim/barn_data.h"

#include <cstdio>
#include <fstream>
#include <sstream>

namespace slalom::sim {

std::filesystem::path BarnDirectory() {
  return std::filesystem::path(SLALOM_SOURCE_DIR) / ".." / "shared" / "barn";
}

bool HasBarnData() { return std::filesystem::exists(BarnDirectory() / "static_grids.txt"); }

std::vector<BarnWorld> ReadBarnWorlds() {
  std::vector<BarnWorld> worlds;
  std::ifstream grids(BarnDirectory() / "static_grids.txt");
  int row_from_goal = 0;
  for (std::string line; std::getline(grids, line);) {
    if (line.starts_with(";") || line.empty()) continue;
    if (line.starts_with("world ")) {
      worlds.push_back({std::stoi(line.substr(6)), {}, {}});
      row_from_goal = 0;
      continue;
    }
    const int y = 63 - row_from_goal++;
    for (int x = 0; x < static_cast<int>(line.size()); ++x) {
      if (line[static_cast<std::size_t>(x)] != '#') continue;
      worlds.back().circles.push_back(
          {{(-4425 + 150 * x) / 1000.0, (75 + 150 * y) / 1000.0}, 0.075});
    }
  }
  std::ifstream paths(BarnDirectory() / "static_paths.csv");
  std::string line;
  std::getline(paths, line);
  while (std::getline(paths, line)) {
    int world = 0, i = 0, row = 0, col = 0;
    if (std::sscanf(line.c_str(), "%d,%d,%d,%d", &world, &i, &row, &col) != 4) continue;
    worlds.at(static_cast<std::size_t>(world)).path.push_back({row, col});
  }
  return worlds;
}

std::vector<std::vector<MovingObstacle>> ReadBarnMotions(const std::string& file) {
  std::vector<std::vector<MovingObstacle>> worlds;
  std::ifstream lines(BarnDirectory() / file);
  std::string line;
  std::getline(lines, line);
  int last_world = -1;
  while (std::getline(lines, line)) {
    int world = 0;
    double size_x = 0, size_y = 0, x0 = 0, y0 = 0, x1 = 0, y1 = 0, yaw = 0, period = 0;
    if (std::sscanf(line.c_str(), "%d,%*[^,],%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf", &world, &size_x,
                    &size_y, &x0, &y0, &x1, &y1, &yaw, &period) != 9) {
      continue;
    }
    if (world != last_world) worlds.emplace_back();
    last_world = world;
    worlds.back().push_back({.radius = 0.0,
                             .half_size = {size_x / 2, size_y / 2},
                             .key_frames = {{0.0, {{x0, y0}, yaw}}, {period, {{x1, y1}, yaw}}},
                             .playback = Playback::kLoop});
  }
  return worlds;
}

}  // namespace slalom::sim
