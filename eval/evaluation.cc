#include "eval/evaluation.h"

#include <fmt/format.h>

#include <utility>

#include "base/check.h"
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
  sim::CourseEnvironments environments(
      task.environment, sim::MakeScenes(task.courses), task.num_environments, parallel,
      task.physics.make_bodies ? task.physics.make_bodies : sim::MakeRobots());
  const std::unique_ptr<env::Agent> agent = make_agent(environments);
  return Evaluate(task, environments, *agent, progress, std::move(stop));
}

std::string DescribeOverlap(const TrainingOverlap& overlap) {
  SLALOM_CHECK(overlap.num_courses > 0);
  return fmt::format(
      "{} of the {} courses {} among those that the policy was trained on ({}): there the score "
      "says what it remembers, not how it drives on new courses",
      overlap.num_courses, overlap.num_scored, overlap.num_courses == 1 ? "is" : "are",
      overlap.trained_on);
}

}  // namespace slalom::eval
