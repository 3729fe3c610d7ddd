#include "app/train/evaluate_planner.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "base/config.h"
#include "base/version.h"
#include "planners/planner_agent.h"
#include "sim/courses/course_sets.h"
#include "sim/lidar.h"

namespace slalom::cli {

PreparedRun PreparePlanner(const std::string& name, const train::AgentRunConfig& config,
                           const std::string& courses_spec, base::ParallelFor& parallel) {
  (void)planners::NavigationOf(name, config.planners);  // Before any work, that there is one.
  const sim::CourseSet courses =
      sim::ResolveCourses(courses_spec, config.courses.collection,
                          static_cast<std::uint64_t>(config.courses.generator_seed));
  eval::Provenance provenance;
  provenance.agent = name;
  provenance.kind = "planner";
  provenance.source = name;
  provenance.course_set = courses_spec;
  provenance.collection = config.courses.collection;
  provenance.commit = base::Commit();
  provenance.config = config::ToToml(config);
  const auto make_agent = [name, planners_config = config.planners, &parallel](
                              int, const sim::EnvironmentConfig& environment) {
    const sim::LidarConfig& lidar = environment.lidar;
    const planners::ScanGeometry geometry{
        lidar.num_beams,
        lidar.field_of_view,
        {lidar.offset_x, lidar.offset_y},
        std::min(environment.observation.range_clip, sim::LongestEcho(lidar))};
    return std::make_unique<planners::PlannerAgent>(
        name, planners_config, geometry, environment.action, environment.episode.step, &parallel);
  };
  return {eval::ResolveEvaluation(config.evaluation, config.environment, courses), make_agent,
          std::move(provenance)};
}

}  // namespace slalom::cli
