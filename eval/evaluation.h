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
#include "eval/evaluation_config.h"
#include "eval/summary.h"
#include "sim/course.h"
#include "sim/environment_config.h"

namespace slalom::eval {

/// An evaluation with all that its reports need. A value.
struct Evaluation {
  EvaluationConfig protocol;
  sim::EpisodeConfig clock;  ///< Of the environments it was driven in.
  std::string course_set;    ///< Name of the set.
  Episodes episodes;
  Summary summary;
};

/// The environments' config under the protocol: `environment` with the protocol's start jitter.
sim::EnvironmentConfig WithProtocol(sim::EnvironmentConfig environment,
                                    const EvaluationConfig& protocol);

/// How many environments to make: `num_environments`, but no more than there are episodes.
int NumEnvironments(const EvaluationConfig& protocol, const sim::CourseSet& courses);

/// Drives the protocol's episodes (`RunEpisodes`, with its requirements) and sums them up.
/// `environment` is the config of `environments`, `WithProtocol`. None: `stop` was requested first.
[[nodiscard]] std::optional<Evaluation> Evaluate(const EvaluationConfig& protocol,
                                                 const sim::EnvironmentConfig& environment,
                                                 const sim::CourseSet& courses,
                                                 env::BatchEnvironment& environments,
                                                 env::Agent& agent, const Progress& progress = {},
                                                 std::stop_token stop = {});

/// Makes the agent that drives `batch_size` environments.
using MakeAgent = std::function<std::unique_ptr<env::Agent>(int batch_size)>;

/// The whole of an evaluation in environments of its own: `environment` is the task's config, to
/// which the protocol is applied here. `parallel` may be null (see `sim::CourseEnvironments`); it
/// changes the speed, not the result. None: `stop` was requested first.
/// Throws `base::Error` where a course cannot be started.
[[nodiscard]] std::optional<Evaluation> EvaluateOnCourses(
    const EvaluationConfig& protocol, const sim::EnvironmentConfig& environment,
    const sim::CourseSet& courses, const MakeAgent& make_agent, base::ParallelFor* parallel,
    const Progress& progress = {}, std::stop_token stop = {});

}  // namespace slalom::eval
