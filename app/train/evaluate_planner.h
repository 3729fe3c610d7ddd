#pragma once

#include <string>

#include "app/train/agent_run_config.h"
#include "app/train/scored_run.h"
#include "base/parallel.h"

namespace slalom::cli {

/// Prepares to drive the classical planner `name` over the courses of `courses_spec`, as
/// `PreparePolicy` does a policy. `parallel`: threads on which it plans; they must outlive the
/// result. Throws `base::Error` if there is no such planner (the error lists them) or the courses
/// cannot be read.
PreparedRun PreparePlanner(const std::string& name, const train::AgentRunConfig& config,
                           const std::string& courses_spec, base::ParallelFor& parallel);

}  // namespace slalom::cli
