#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/sweep/cell.h"

/// The command lines with which a sweep trains and scores. Each begins with `program`, the path of
/// `slalom`.

namespace slalom::sweep {

/// Trains a run below `output` from a config, or goes on with the run `output` if there is no
/// config. Scores nothing.
std::vector<std::string> TrainCommand(const std::filesystem::path& program,
                                      const std::optional<std::filesystem::path>& config,
                                      const std::filesystem::path& output);

/// Environment variables that give the libraries of a child process so many threads.
std::vector<std::string> ThreadLimits(int threads);

/// Runs a process of a service.
std::vector<std::string> ServiceCommand(const std::filesystem::path& program,
                                        const std::string& role,
                                        const std::filesystem::path& config,
                                        const std::string& name);

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
