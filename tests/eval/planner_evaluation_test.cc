#include <gtest/gtest.h>

#include <memory>

#include "eval/evaluation.h"
#include "planners/planner_agent.h"
#include "sim/courses/course_sets.h"

namespace slalom::eval {
namespace {

Evaluation Drive(int num_environments, base::ParallelFor* parallel) {
  EvaluationConfig config;
  config.episodes_per_course = 2;
  config.num_environments = num_environments;
  config.time_limit = 6.0;
  sim::EnvironmentConfig task;
  task.episode.step = 0.05;
  task.robot.control_rate = 100.0;
  const auto make_agent = [&](const sim::CourseEnvironments& environments) {
    const sim::EnvironmentConfig& environment = environments.config();
    const env::ScanGeometry geometry{environment.lidar.num_beams,
                                     environment.lidar.field_of_view,
                                     {environment.lidar.offset_x, environment.lidar.offset_y},
                                     environment.observation.range_clip};
    return std::make_unique<planners::PlannerAgent>("dwa", planners::PlannersConfig{}, geometry,
                                                    environment.action, environment.episode.step,
                                                    parallel);
  };
  const sim::CourseSet courses = sim::ResolveCourses("generated:5:3", std::nullopt, 0);
  return EvaluateOnCourses(ResolveEvaluation(config, task, courses), make_agent, parallel).value();
}

// A planner keeps maps from step to step, so it would betray episodes that share anything.
TEST(PlannerEvaluation, DoesNotDependOnBatchSizeOrThreads) {
  const Evaluation alone = Drive(1, nullptr);
  ASSERT_EQ(alone.episodes.records.size(), 6u);
  base::ParallelFor parallel(3);
  for (const int num_environments : {4, 6}) {
    const Evaluation other = Drive(num_environments, &parallel);
    EXPECT_EQ(other.episodes.records, alone.episodes.records) << num_environments;
    EXPECT_EQ(other.episodes.tracks, alone.episodes.tracks) << num_environments;
  }
}

}  // namespace
}  // namespace slalom::eval
