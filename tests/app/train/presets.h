#pragma once

#include <algorithm>
#include <filesystem>
#include <vector>

namespace slalom::test {

/// Every preset that trains, below configs/: neither a task of planners, a profile of a robot, nor
/// a plan of sweeps. In the order of their names.
inline std::vector<std::filesystem::path> TrainingPresets() {
  const std::filesystem::path root = std::filesystem::path(SLALOM_SOURCE_DIR) / "configs";
  std::vector<std::filesystem::path> presets;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
    const std::filesystem::path folder = *entry.path().lexically_relative(root).begin();
    const bool is_other = folder == "planners" || folder == "robots" || folder == "sweeps";
    if (entry.path().extension() != ".toml" || is_other) continue;
    presets.push_back(entry.path());
  }
  std::sort(presets.begin(), presets.end());
  return presets;
}

}  // namespace slalom::test
