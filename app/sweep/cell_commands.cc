#include "app/sweep/cell_commands.h"

#include <algorithm>

#include "app/train/command_options.h"

namespace slalom::sweep {

std::vector<std::string> TrainCommand(const fs::path& program,
                                      const std::optional<fs::path>& config,
                                      const fs::path& output) {
  if (!config) {
    return {program.string(), "train", output.string(), train::kResumeOption,
            train::kNoEvaluationOption};
  }
  return {program.string(),     "train",         config->string(),
          train::kOutputOption, output.string(), train::kNoEvaluationOption};
}

std::vector<std::string> ThreadLimits(int threads) {
  const std::string count = std::to_string(threads);
  return {"OMP_NUM_THREADS=" + count, "OPENBLAS_NUM_THREADS=" + count};
}

std::vector<std::string> EvaluateCommand(const fs::path& program, const Cell& cell,
                                         const ScoreTask& task, const ScoreCommand& score) {
  return {program.string(),
          "evaluate",
          score.policy ? train::kPolicyOption : train::kAgentOption,
          score.policy ? score.policy->string() : cell.planner,
          train::kConfigOption,
          score.config.string(),
          train::kCoursesOption,
          task.courses,
          train::kPhysicsOption,
          task.physics,
          train::kOutputOption,
          score.output.string(),
          train::kForceOption,
          train::kNameOption,
          cell.row_name(),
          train::kThreadsOption,
          std::to_string(std::min(score.threads, train::kMaxThreads))};
}

}  // namespace slalom::sweep
