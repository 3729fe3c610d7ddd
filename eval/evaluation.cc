#include "eval/evaluation.h"

#include <utility>

#include "sim/environments.h"
#include "sim/scene.h"

namespace slalom::eval {

std::optional<Evaluation> Evaluate(const EvaluationTask& task, env::BatchEnvironment& environments,
                                   env::Agent& agent, const Progress& progress,
                                   std::stop_token stop) {
  auto episodes = RunEpisodes(task, environments, agent, progress, std::move(stop));
  if (!episodes) return std::nullopt;
  Summary summary = Summarise(episodes->records, task.courses, task.environment.episode.step,
                              task.protocol.time_limit);
  return Evaluation{task, *std::move(episodes), std::move(summary)};
}

std::optional<Evaluation> EvaluateOnCourses(const EvaluationTask& task, const MakeAgent& make_agent,
                                            base::ParallelFor* parallel, const Progress& progress,
                                            std::stop_token stop) {
  sim::CourseEnvironments environments(task.environment, sim::MakeScenes(task.courses),
                                       task.num_environments, parallel);
  const std::unique_ptr<env::Agent> agent = make_agent(task.num_environments, task.environment);
  return Evaluate(task, environments, *agent, progress, std::move(stop));
}

}  // namespace slalom::eval
