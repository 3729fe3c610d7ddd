#pragma once

#include <memory>

#include "env/agent.h"
#include "eval/evaluation.h"
#include "planners/guard/guarded_agent.h"
#include "sim/environment_config.h"

/// What stands between an agent and the robot of a task (planners/guard/).

namespace slalom::train {

/// What a guard is told of the task's robot: outline, masses, wheels, friction, accelerations and
/// the longest delay. Not what nobody could tell it: gains, imbalance, errors of the odometry.
planners::GuardedRobot GuardedRobotOf(const sim::EnvironmentConfig& environment);

/// The agent itself or, if the guard is enabled, the agent under it, for robots of `environment`: a
/// `planners::ScanMatchingAgent` if it matches scans, else a `planners::GuardedAgent`. Throws
/// `base::Error` that names the key if it is not enabled, but another of its keys is set.
std::unique_ptr<env::Agent> Guarded(std::unique_ptr<env::Agent> agent,
                                    const planners::GuardConfig& guard,
                                    const sim::EnvironmentConfig& environment);

/// Makers of the same agents, likewise.
eval::MakeAgent Guarded(eval::MakeAgent make_agent, const planners::GuardConfig& guard);

}  // namespace slalom::train
