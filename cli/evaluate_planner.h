#pragma once

#include <optional>
#include <stop_token>
#include <string>

#include "base/parallel.h"
#include "cli/scored_run.h"
#include "train/agent_run_config.h"

namespace slalom::cli {

/// Drives the classical planner `name` over the courses of `courses_spec`, as `EvaluatePolicy` does
/// a policy. Returns nothing if it was stopped before the end. Throws `base::Error` if there is no
/// such planner (the error lists them) or the courses cannot be read.
std::optional<ScoredRun> EvaluatePlanner(const std::string& name,
                                         const train::AgentRunConfig& config,
                                         const std::string& courses_spec,
                                         base::ParallelFor& parallel, std::stop_token stop);

}  // namespace slalom::cli
