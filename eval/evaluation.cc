#include "eval/evaluation.h"

#include <algorithm>
#include <utility>

#include "sim/environments.h"
#include "sim/scene.h"

namespace slalom::eval {

sim::EnvironmentConfig WithProtocol(sim::EnvironmentConfig environment,
                                    const EvaluationConfig& protocol) {
  environment.episode.start_position_jitter = protocol.start_position_jitter;
  environment.episode.start_yaw_jitter = protocol.start_yaw_jitter;
  return environment;
}

int NumEnvironments(const EvaluationConfig& protocol, const sim::CourseSet& courses) {
  const auto num_episodes = static_cast<std::int64_t>(courses.courses.size()) *
                            static_cast<std::int64_t>(protocol.episodes_per_course);
  return static_cast<int>(std::min<std::int64_t>(protocol.num_environments, num_episodes));
}

std::optional<Evaluation> Evaluate(const EvaluationConfig& protocol,
                                   const sim::EnvironmentConfig& environment,
                                   const sim::CourseSet& courses,
                                   env::BatchEnvironment& environments, env::Agent& agent,
                                   const Progress& progress, std::stop_token stop) {
  auto episodes = RunEpisodes(protocol, courses, environments, agent, progress, std::move(stop));
  if (!episodes) return std::nullopt;
  Summary summary = Summarise(episodes->records, courses, environment.episode);
  return Evaluation{protocol, environment.episode, courses.name, *std::move(episodes),
                    std::move(summary)};
}

std::optional<Evaluation> EvaluateOnCourses(const EvaluationConfig& protocol,
                                            const sim::EnvironmentConfig& environment,
                                            const sim::CourseSet& courses,
                                            const MakeAgent& make_agent,
                                            base::ParallelFor* parallel, const Progress& progress,
                                            std::stop_token stop) {
  const sim::EnvironmentConfig config = WithProtocol(environment, protocol);
  const int batch_size = NumEnvironments(protocol, courses);
  sim::CourseEnvironments environments(config, sim::MakeScenes(courses), batch_size, parallel);
  const std::unique_ptr<env::Agent> agent = make_agent(batch_size);
  return Evaluate(protocol, config, courses, environments, *agent, progress, std::move(stop));
}

}  // namespace slalom::eval
