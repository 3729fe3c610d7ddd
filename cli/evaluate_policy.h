#pragma once

#include <optional>
#include <stop_token>
#include <string>

#include "base/parallel.h"
#include "cli/scored_run.h"
#include "policy/policy.h"
#include "train/run_config.h"

namespace slalom::cli {

/// Drives a policy over the courses of `courses_spec` with the task, collection and protocol of
/// `config`, showing progress on standard error. `trained`: the courses of its training, of which a
/// warning says how many are driven here; none: not known, or of no interest. Returns none where it
/// was stopped first. Throws `base::Error` where the policy does not fit the task (naming
/// `policy_source`) or the courses cannot be had.
std::optional<ScoredRun> EvaluatePolicy(const policy::PolicySnapshot& policy,
                                        const std::string& policy_source,
                                        const train::RunConfig& config,
                                        const std::string& courses_spec,
                                        const std::optional<train::CoursesConfig>& trained,
                                        base::ParallelFor& parallel, std::stop_token stop);

}  // namespace slalom::cli
