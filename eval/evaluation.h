#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "base/parallel.h"
#include "env/agent.h"
#include "env/environment.h"
#include "eval/episodes.h"
#include "eval/evaluation_task.h"
#include "eval/summary.h"
#include "sim/environments.h"

namespace slalom::eval {

/// Counts the courses on which a policy is scored and was also trained. A value.
struct TrainingOverlap {
  int num_courses = 0;     ///< Scored courses that were trained on, too.
  int num_scored = 0;      ///< Scored courses.
  std::string trained_on;  ///< The set that it was trained on, as its config names it.

  friend bool operator==(const TrainingOverlap&, const TrainingOverlap&) = default;
};

/// "40 of the 50 courses are among those that the policy was trained on (static-train-250): ...", a
/// sentence for warnings. Requires: num_courses > 0.
std::string DescribeOverlap(const TrainingOverlap& overlap);

/// An evaluation with everything that its reports need. A value.
struct Evaluation {
  EvaluationTask task;
  Episodes episodes;
  Summary summary;
  /// Empty if the agent was not trained, or if its training courses are not known.
  std::optional<TrainingOverlap> training_overlap = std::nullopt;
};

/// Drives the episodes (`RunEpisodes`, with its requirements) and summarises them. Returns nothing
/// if `stop` was requested before the end.
[[nodiscard]] std::optional<Evaluation> Evaluate(const EvaluationTask& task,
                                                 env::BatchEnvironment& environments,
                                                 env::Agent& agent, const Progress& progress = {},
                                                 std::stop_token stop = {});

/// Makes the agent that drives these environments, which outlive it.
using MakeAgent =
    std::function<std::unique_ptr<env::Agent>(const sim::CourseEnvironments& environments)>;

/// Runs a complete evaluation in environments of its own. `parallel` may be null (see
/// `sim::CourseEnvironments`); it changes the speed, not the result. Returns nothing if `stop` was
/// requested before the end. Throws `base::Error` if a course cannot be started, or not in the
/// task's physics.
[[nodiscard]] std::optional<Evaluation> EvaluateOnCourses(const EvaluationTask& task,
                                                          const MakeAgent& make_agent,
                                                          base::ParallelFor* parallel,
                                                          const Progress& progress = {},
                                                          std::stop_token stop = {});

}  // namespace slalom::eval
