#include "train/agent_run_config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/log.h"
#include "config/config.h"
#include "train/run_config.h"

namespace slalom::train {

AgentRunConfig ReadAgentRunConfig(const std::filesystem::path& path) {
  AgentRunConfig config;
  RunConfig others;
  const auto passed_over =
      config::ReadSharedTomlFile(path, config::ListFields(config), config::ListFields(others));
  if (!passed_over.empty()) {
    spdlog::info("{}: a planner does not read {}", path.string(), fmt::join(passed_over, ", "));
  }
  return config;
}

}  // namespace slalom::train
