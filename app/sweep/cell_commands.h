#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/sweep/cell.h"

/// The commands that train and score a cell.

namespace slalom::sweep {

/// Trains a run below `output` from a config, or goes on with the run `output` if there is no
/// config. Scores nothing.
std::vector<std::string> TrainCommand(const std::filesystem::path& program,
                                      const std::optional<std::filesystem::path>& config,
                                      const std::filesystem::path& output);

/// Environment variables that give the libraries of a child process so many threads.
std::vector<std::string> ThreadLimits(int threads);

/// One evaluation that `EvaluateCommand` runs.
struct ScoreCommand {
  std::optional<std::filesystem::path> policy;  ///< Empty if the cell's planner drives.
  std::filesystem::path config;
  std::filesystem::path output;  ///< Replaced if it is there.
  int threads = 1;
};

/// Scores a cell as `task` says.
std::vector<std::string> EvaluateCommand(const std::filesystem::path& program, const Cell& cell,
                                         const ScoreTask& task, const ScoreCommand& score);

}  // namespace slalom::sweep
