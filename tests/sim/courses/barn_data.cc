#include "tests/sim/courses/barn_data.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <stdexcept>

namespace slalom::sim {

namespace {

constexpr const char* kVariable = "SLALOM_BARN_DATA";
constexpr const char* kManual = "docs/courses.md, \"The published worlds in tests\"";

constexpr const char* kFiles[] = {"barn_worlds.tar.xz",
                                  "dynamic_box.csv",
                                  "dynamic_box_fixed.csv",
                                  "dynamic_wall.csv",
                                  "dynamic_wall_fixed.csv",
                                  "sample_worlds/path_0.npy",
                                  "sample_worlds/path_299.npy",
                                  "sample_worlds/world_0.world",
                                  "sample_worlds/world_299.world",
                                  "sample_worlds/world_300.world",
                                  "sample_worlds/world_400.world",
                                  "splits.json",
                                  "static_grids.txt",
                                  "static_paths.csv"};

[[noreturn]] void Refuse(const std::filesystem::path& file, const std::string& line) {
  throw std::runtime_error(file.string() + ": unexpected line '" + line + "'; see " + kManual);
}

}  // namespace

std::span<const char* const> BarnFiles() { return kFiles; }

BarnData FindBarnData(const char* value) {
  if (value == nullptr || *value == '\0') return {};
  BarnData data{value, ""};
  const std::string name = std::string(kVariable) + " is '" + value + "', which ";
  if (!std::filesystem::is_directory(*data.directory)) {
    data.fault = name + "is not a directory; see " + kManual;
    return data;
  }
  std::string missing;
  for (const char* file : kFiles) {
    if (std::filesystem::is_regular_file(*data.directory / file)) continue;
    missing += (missing.empty() ? "" : ", ") + std::string(file);
  }
  if (!missing.empty()) data.fault = name + "lacks " + missing + "; see " + kManual;
  return data;
}

void PublishedWorlds::SetUp() {
  const BarnData data = FindBarnData(std::getenv(kVariable));
  if (!data.directory) {
    GTEST_SKIP() << kVariable << " is not set, so there are no published worlds to compare with; "
                 << kManual << ", says where to get them";
  }
  if (!data.fault.empty()) FAIL() << data.fault;
  directory_ = *data.directory;
}

std::vector<BarnWorld> ReadBarnWorlds(const std::filesystem::path& directory) {
  std::vector<BarnWorld> worlds;
  const std::filesystem::path grids_file = directory / "static_grids.txt";
  std::ifstream grids(grids_file);
  int row_from_goal = 0;
  for (std::string line; std::getline(grids, line);) {
    if (line.starts_with(";") || line.empty()) continue;
    if (line.starts_with("world ")) {
      worlds.push_back({std::stoi(line.substr(6)), {}, {}});
      row_from_goal = 0;
      continue;
    }
    if (worlds.empty() || line.size() != 30) Refuse(grids_file, line);
    const int y = 63 - row_from_goal++;
    for (int x = 0; x < static_cast<int>(line.size()); ++x) {
      if (line[static_cast<std::size_t>(x)] != '#') continue;
      worlds.back().circles.push_back(
          {{(-4425 + 150 * x) / 1000.0, (75 + 150 * y) / 1000.0}, 0.075});
    }
  }
  const std::filesystem::path paths_file = directory / "static_paths.csv";
  std::ifstream paths(paths_file);
  std::string line;
  std::getline(paths, line);
  while (std::getline(paths, line)) {
    int world = 0, i = 0, row = 0, col = 0;
    if (std::sscanf(line.c_str(), "%d,%d,%d,%d", &world, &i, &row, &col) != 4 || world < 0 ||
        world >= static_cast<int>(worlds.size())) {
      Refuse(paths_file, line);
    }
    worlds[static_cast<std::size_t>(world)].path.push_back({row, col});
  }
  return worlds;
}

std::vector<std::vector<MovingObstacle>> ReadBarnMotions(const std::filesystem::path& file) {
  std::vector<std::vector<MovingObstacle>> worlds;
  std::ifstream lines(file);
  std::string line;
  std::getline(lines, line);
  int last_world = -1;
  while (std::getline(lines, line)) {
    int world = 0;
    double size_x = 0, size_y = 0, x0 = 0, y0 = 0, x1 = 0, y1 = 0, yaw = 0, period = 0;
    if (std::sscanf(line.c_str(), "%d,%*[^,],%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf", &world, &size_x,
                    &size_y, &x0, &y0, &x1, &y1, &yaw, &period) != 9) {
      Refuse(file, line);
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

double DistributionDistance(std::vector<double> a, std::vector<double> b) {
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  double largest = 0.0;
  for (const std::vector<double>* sample : {&a, &b}) {
    for (const double x : *sample) {
      const auto below = [x](const std::vector<double>& v) {
        return static_cast<double>(std::upper_bound(v.begin(), v.end(), x) - v.begin()) /
               static_cast<double>(v.size());
      };
      largest = std::max(largest, std::abs(below(a) - below(b)));
    }
  }
  return largest;
}

}  // namespace slalom::sim
