#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sim/courses/barn_field.h"
#include "sim/courses/course.h"

/// The published worlds as plain text, for tests that compare with them. They are not part of this
/// repository: the environment variable SLALOM_BARN_DATA names the directory that holds them, and
/// docs/courses.md, "The published worlds in tests", says what it must hold and where it comes
/// from.

namespace slalom::sim {

/// Where the published worlds are. Neither member is set where nobody said so.
struct BarnData {
  std::optional<std::filesystem::path> directory;
  std::string fault;  ///< Why `directory` cannot be used; empty if it can.
};

/// Looks for the published worlds where `value` says, the value of SLALOM_BARN_DATA: a directory,
/// or null or empty where the variable is not set.
BarnData FindBarnData(const char* value);

/// The files, as paths from the directory, without which `FindBarnData` finds a fault.
std::span<const char* const> BarnFiles();

/// A test that reads the published worlds. It skips itself where SLALOM_BARN_DATA is not set, and
/// fails where `FindBarnData` finds a fault.
class PublishedWorlds : public testing::Test {
 protected:
  void SetUp() override;

  /// Requires: `SetUp` found the data.
  const std::filesystem::path& directory() const { return directory_; }

 private:
  std::filesystem::path directory_;
};

/// One static world of static_grids.txt and static_paths.csv.
struct BarnWorld {
  int number = 0;
  std::vector<Circle> circles;  ///< Unsorted.
  std::vector<Cell> path;
};

/// All static worlds, by number. Throws std::runtime_error on a line that it cannot read.
std::vector<BarnWorld> ReadBarnWorlds(const std::filesystem::path& directory);

/// The moving obstacles of each world of `file`, dynamic_box.csv or dynamic_wall.csv, by world.
/// Throws std::runtime_error on a line that it cannot read.
std::vector<std::vector<MovingObstacle>> ReadBarnMotions(const std::filesystem::path& file);

/// Largest distance between the distribution functions of two samples (Kolmogorov-Smirnov).
double DistributionDistance(std::vector<double> a, std::vector<double> b);

}  // namespace slalom::sim
