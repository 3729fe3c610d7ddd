#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>

#include "base/parallel.h"
#include "env/agent.h"
#include "env/environment.h"
#include "eval/episodes.h"
#include "eval/evaluation_config.h"
#include "eval/protocol.h"
#include "eval/summary.h"
#include "eval/training_overlap.h"
#include "sim/courses/course.h"
#include "sim/environment_config.h"

namespace slalom::eval {

/// An evaluation with everything that its reports need. A value.
struct Evaluation {
  EvaluationConfig config;
  sim::EnvironmentConfig environment;  ///< With the protocol applied (`WithProtocol`).
  sim::CourseSet courses;              ///< With the protocol applied (`WithProtocol`).
  Episodes episodes;
  Summary summary;
  /// None: the agent was not trained, or its training courses are not known.
  std::optional<TrainingOverlap> training_overlap = std::nullopt;
};

/// Returns how many environments to make: `num_environments`, but at most the number of episodes.
int NumEnvironments(const EvaluationConfig& config, const sim::CourseSet& courses);

/// Drives the episodes (`RunEpisodes`, with its requirements) and summarises them. `environment` is
/// the config of `environments`, with the protocol applied. Returns nothing if `stop` was requested
/// before the end.
[[nodiscard]] std::optional<Evaluation> Evaluate(const EvaluationConfig& config,
                                                 const sim::EnvironmentConfig& environment,
                                                 const sim::CourseSet& courses,
                                                 env::BatchEnvironment& environments,
                                                 env::Agent& agent, const Progress& progress = {},
                                                 std::stop_token stop = {});

/// Makes the agent that drives `batch_size` environments of this config.
using MakeAgent = std::function<std::unique_ptr<env::Agent>(
    int batch_size, const sim::EnvironmentConfig& environment)>;

/// Runs a complete evaluation in environments of its own. `environment` and `courses` are the
/// task's; the protocol is applied here. `parallel` may be null (see `sim::CourseEnvironments`); it
/// changes the speed, not the result. Returns nothing if `stop` was requested before the end.
/// Throws `base::Error` if a course cannot be started.
[[nodiscard]] std::optional<Evaluation> EvaluateOnCourses(
    const EvaluationConfig& config, const sim::EnvironmentConfig& environment,
    const sim::CourseSet& courses, const MakeAgent& make_agent, base::ParallelFor* parallel,
    const Progress& progress = {}, std::stop_token stop = {});

}  // namespace slalom::eval
