#include "app/train/agent_run_config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "app/train/guarded.h"
#include "app/train/planner_fit.h"
#include "app/train/run_config.h"
#include "base/config.h"
#include "base/error.h"
#include "base/log.h"
#include "eval/oracle_agent.h"
#include "planners/planner_agent.h"
#include "sim/environments.h"
#include "sim/lidar.h"

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
  FitToRobot(config.environment, config.planners);
  return config;
}

std::vector<std::string> PlannerAndOracleNames() {
  std::vector<std::string> names = planners::PlannerNames();
  names.emplace_back(eval::kOracle);
  return names;
}

void RequireReadBy(const std::string& driver, std::string_view key, std::string_view where) {
  const std::string section(key.substr(0, key.find('.')));
  const std::vector<std::string> names = planners::PlannerNames();
  const bool is_planners = std::ranges::find(names, section) != names.end();
  const bool is_unread = driver == eval::kOracle ? is_planners || section == "navigation"
                                                 : is_planners && section != driver;
  if (!is_unread) return;
  throw base::Error(
      fmt::format("{}: {} does not read {}, expected a key that it reads: those of "
                  "[{}] are {}'s",
                  where, driver, key, section, is_planners ? section : "a planner"));
}

eval::MakeAgent MakePlanners(const std::string& name, const planners::PlannersConfig& config,
                             base::ParallelFor& parallel) {
  const std::vector<std::string> names = PlannerAndOracleNames();
  if (std::ranges::find(names, name) == names.end()) {
    throw base::Error(
        fmt::format("there is no planner '{}', expected one of {}", name, fmt::join(names, ", ")));
  }
  if (name == eval::kOracle) {
    return [&parallel](const sim::CourseEnvironments& environments) {
      return std::make_unique<eval::OracleAgent>(environments, &parallel);
    };
  }
  return [name, config, &parallel](const sim::CourseEnvironments& environments) {
    const sim::EnvironmentConfig& environment = environments.config();
    return std::make_unique<planners::PlannerAgent>(name, config, sim::ScanGeometryOf(environment),
                                                    environment.action, environment.episode.step,
                                                    &parallel);
  };
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

template slalom::config::FieldList slalom::config::ListFields(
    slalom::train::AgentRunConfig& config);
