#pragma once

#include <optional>
#include <stop_token>
#include <string>

#include "app/train/run_config.h"
#include "app/train/scored_run.h"
#include "base/parallel.h"
#include "policy/policy.h"

namespace slalom::cli {

/// Prepares to drive a policy over the courses of `courses_spec` with the task, collection and
/// protocol of `config`. `trained`: the courses that it was trained on; a warning says how many of
/// them are driven here. Give none if they are not known or do not matter. Throws `base::Error` if
/// the policy does not fit the task (the error names `policy_source`) or the courses cannot be
/// read.
PreparedRun PreparePolicy(const policy::PolicySnapshot& policy, const std::string& policy_source,
                          const train::RunConfig& config, const std::string& courses_spec,
                          const std::optional<train::CoursesConfig>& trained);

/// `PreparePolicy` and `RunScored` in one.
std::optional<ScoredRun> EvaluatePolicy(const policy::PolicySnapshot& policy,
                                        const std::string& policy_source,
                                        const train::RunConfig& config,
                                        const std::string& courses_spec,
                                        const std::optional<train::CoursesConfig>& trained,
                                        base::ParallelFor& parallel, std::stop_token stop);

}  // namespace slalom::cli
