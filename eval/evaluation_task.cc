#include "eval/evaluation_task.h"

#include <algorithm>

namespace slalom::eval {

EvaluationTask ResolveEvaluation(const EvaluationConfig& config,
                                 const sim::EnvironmentConfig& environment,
                                 const sim::CourseSet& courses) {
  EvaluationTask task;
  task.protocol = ResolveProtocol(config);
  task.environment = WithProtocol(environment, task.protocol);
  task.environment.episode.start_position_jitter = config.start_position_jitter;
  task.environment.episode.start_yaw_jitter = config.start_yaw_jitter;
  task.courses = WithProtocol(courses, task.protocol);
  task.episodes_per_course = config.episodes_per_course;
  task.seed = config.seed;
  task.num_environments = std::min(config.num_environments, task.num_episodes());
  task.recording = {config.recorded_episodes_per_course, config.recorded_scan_courses,
                    config.recorded_beams};
  return task;
}

}  // namespace slalom::eval
