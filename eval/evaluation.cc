#include "eval/evaluation.h"

#include <algorithm>
#include <utility>

#include "sim/environments.h"
#include "sim/scene.h"

namespace slalom::eval {

int NumEnvironments(const EvaluationConfig& config, const sim::CourseSet& courses) {
  const auto num_episodes = static_cast<std::int64_t>(courses.courses.size()) *
                            static_cast<std::int64_t>(config.episodes_per_course);
  return static_cast<int>(std::min<std::int64_t>(config.num_environments, num_episodes));
}

std::optional<Evaluation> Evaluate(const EvaluationConfig& config,
                                   const sim::EnvironmentConfig& environment,
                                   const sim::CourseSet& courses,
                                   env::BatchEnvironment& environments, env::Agent& agent,
                                   const Progress& progress, std::stop_token stop) {
  auto episodes =
      RunEpisodes(config, environment, courses, environments, agent, progress, std::move(stop));
  if (!episodes) return std::nullopt;
  Summary summary = Summarise(episodes->records, courses, environment.episode.step,
                              ResolveProtocol(config).time_limit);
  return Evaluation{config, environment, courses, *std::move(episodes), std::move(summary)};
}

std::optional<Evaluation> EvaluateOnCourses(const EvaluationConfig& config,
                                            const sim::EnvironmentConfig& environment,
                                            const sim::CourseSet& courses,
                                            const MakeAgent& make_agent,
                                            base::ParallelFor* parallel, const Progress& progress,
                                            std::stop_token stop) {
  const sim::EnvironmentConfig task = WithProtocol(environment, config);
  const sim::CourseSet placed = WithProtocol(courses, config);
  const int batch_size = NumEnvironments(config, placed);
  sim::CourseEnvironments environments(task, sim::MakeScenes(placed), batch_size, parallel);
  const std::unique_ptr<env::Agent> agent = make_agent(batch_size, task);
  return Evaluate(config, task, placed, environments, *agent, progress, std::move(stop));
}

}  // namespace slalom::eval
