#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/train/run_config.h"
#include "base/parallel.h"
#include "eval/evaluation.h"
#include "eval/evaluation_config.h"
#include "planners/guard/guard_config.h"
#include "planners/planner_registry.h"
#include "sim/environment_config.h"

namespace slalom::train {

/// All settings of `slalom evaluate --agent`. Some defaults differ from a training run's: classical
/// systems are asked for a command 20 times a second, as move_base asks them
/// (docs/original-system.md, section 8.1), and the drive's controller therefore runs at 100 Hz, as
/// 50 Hz is not a multiple of 20 Hz. They are given ranges as long as the sensor's, because their
/// maps tell a long range from a missing echo. They reckon where they are as the Jackal's filter
/// does, from the wheels and the heading.
struct AgentRunConfig {
  AgentRunConfig() {
    environment.episode.step = 0.05;
    environment.robot.control_rate = 100.0;
    environment.observation.range_clip = environment.lidar.max_range;
    environment.localisation.from_wheels = true;
    evaluation.num_environments = 16;
  }

  CollectionConfig courses;
  sim::EnvironmentConfig environment;
  eval::EvaluationConfig evaluation;
  planners::PlannersConfig planners;
  planners::GuardConfig guard;

  template <class Visitor>
  void Visit(Visitor& v) {
    v.Section("courses", courses, "Where set names are looked up.");
    v.Section("environment", environment, "The robot, its sensor and the task.");
    v.Section("evaluation", evaluation, "What an evaluation drives and keeps.");
    planners.Visit(v);
    v.Section("guard", guard, "A check of each action before the robot gets it.");
  }
};

/// Returns the defaults of a protocol whose published figures are from Gazebo and a Jackal that
/// carries an LMS1xx: the robot has Gazebo's friction and that sensor's mass (docs/planners.md).
/// These are "dwa-runs" and "barn-challenge"; any other has no defaults of its own.
std::optional<AgentRunConfig> DefaultsOfPublishedRuns(std::string_view protocol);

/// Returns the defaults after `lay_over` has changed them, with planners that fit the robot
/// (`FitToRobot`). `lay_over` is called on a config twice if the protocol that it asks for has
/// defaults of its own, the second time on these.
AgentRunConfig ResolveAgentRun(const std::function<void(AgentRunConfig&)>& lay_over);

/// The names of what drives without training: the classical planners, and the oracle.
std::vector<std::string> PlannerAndOracleNames();

/// Throws `base::Error` that begins with `where` if the key is of settings that `driver`, a planner
/// or the oracle, does not read: those of another planner.
void RequireReadBy(const std::string& driver, std::string_view key, std::string_view where);

/// Returns the makers of agents that drive evaluations as the classical planner `name`, or the
/// oracle, does. `parallel`: threads on which they plan, which must outlive them. Throws
/// `base::Error` if there is no such planner (the error lists them).
eval::MakeAgent MakePlanners(const std::string& name, const planners::PlannersConfig& config,
                             base::ParallelFor& parallel);

/// Reads a TOML file for a planner on top of `defaults`. The file may be a training run's: keys
/// that only training reads are checked, then ignored, and a line on standard error names them.
/// Throws `base::Error` like `config::ReadTomlFile`.
AgentRunConfig ReadAgentRunConfig(const std::filesystem::path& path, AgentRunConfig defaults = {});

}  // namespace slalom::train

extern template slalom::config::FieldList slalom::config::ListFields(
    slalom::train::AgentRunConfig& config);
