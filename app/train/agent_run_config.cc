#include "app/train/agent_run_config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <utility>

#include "app/train/run_config.h"
#include "base/config.h"
#include "base/log.h"

namespace slalom::train {

std::optional<AgentRunConfig> DefaultsOfPublishedRuns(std::string_view protocol) {
  if (protocol != "dwa-runs" && protocol != "barn-challenge") return std::nullopt;
  AgentRunConfig config;
  config.environment.robot.friction = sim::FrictionLaw::kGazebo;
  config.environment.robot.sensor_mass = 1.1;
  return config;
}

AgentRunConfig ResolveAgentRun(const std::function<void(AgentRunConfig&)>& lay_over) {
  AgentRunConfig config;
  lay_over(config);
  if (auto defaults = DefaultsOfPublishedRuns(config.evaluation.protocol)) {
    config = *std::move(defaults);
    lay_over(config);
  }
  return config;
}

AgentRunConfig ReadAgentRunConfig(const std::filesystem::path& path, AgentRunConfig defaults) {
  AgentRunConfig config = std::move(defaults);
  RunConfig others;
  const auto passed_over =
      config::ReadSharedTomlFile(path, config::ListFields(config), config::ListFields(others));
  if (!passed_over.empty()) {
    spdlog::info("{}: a planner does not read {}", path.string(), fmt::join(passed_over, ", "));
  }
  return config;
}

}  // namespace slalom::train
