#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>

#include "base/parallel.h"
#include "eval/evaluation.h"
#include "eval/report.h"
#include "policy/policy.h"
#include "sim/course.h"
#include "train/run_config.h"

namespace slalom::cli {

/// An evaluation and the courses that it was driven on.
struct PolicyEvaluation {
  sim::CourseSet courses;
  eval::Evaluation evaluation;
  eval::Provenance provenance;
};

/// Drives a policy over the courses of `courses_spec` with the task, collection and protocol of
/// `config`, showing progress on standard error. None: stopped first. Throws `base::Error` where
/// the policy does not fit the task (naming `policy_source`) or the courses cannot be had.
std::optional<PolicyEvaluation> EvaluatePolicy(const policy::PolicySnapshot& policy,
                                               const std::string& policy_source,
                                               const train::RunConfig& config,
                                               const std::string& courses_spec,
                                               base::ParallelFor& parallel, std::stop_token stop);

/// Writes the reports, the trajectories (evaluation-tracks.jsonl) and a picture of the courses with
/// them (courses.png, courses.svg) into `directory`. Throws `base::Error` where that fails.
void WriteEvaluation(const PolicyEvaluation& result, const std::filesystem::path& directory);

}  // namespace slalom::cli
