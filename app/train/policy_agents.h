#pragma once

#include "app/train/run_config.h"
#include "eval/evaluation.h"
#include "policy/policy.h"

namespace slalom::train {

/// Returns the makers of agents that drive evaluations with `policy`, and plan if `config.mpc` says
/// so. The plans' seed is derived from the run's.
eval::MakeAgent MakeAgentsOf(const policy::PolicySnapshot& policy, const RunConfig& config);

}  // namespace slalom::train
