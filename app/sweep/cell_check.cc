#include "app/sweep/cell_check.h"

#include <fmt/format.h>

#include <cmath>

#include "base/error.h"
#include "policy/policy.h"
#include "sim/scene.h"

namespace slalom::sweep {

std::int64_t StepsForUpdates(const train::RunConfig& config, std::int64_t updates) {
  return config.run.learning_starts +
         static_cast<std::int64_t>(
             std::ceil(static_cast<double>(updates) / config.run.updates_per_step));
}

void RequireScorable(const train::RunConfig& trained, const train::RunConfig& task,
                     const std::vector<int>& snapshots) {
  policy::RequireSameInterface("the policy", train::MakePolicySpec(trained),
                               sim::MakeObservationSpec(task.environment), task.environment.action);
  if (task.environment.lidar.field_of_view != trained.environment.lidar.field_of_view) {
    throw base::Error(fmt::format(
        "environment.lidar.field_of_view is {} rad, expected {}, which the policy is trained with",
        task.environment.lidar.field_of_view, trained.environment.lidar.field_of_view));
  }
  if (!task.mpc.enabled) return;
  const std::int64_t first = StepsForUpdates(task, task.mpc.learning_starts);
  for (const std::int64_t steps : snapshots) {
    if (steps >= first) continue;
    throw base::Error(
        fmt::format("there is no planning at {} steps, expected snapshots from {} steps on "
                    "(mpc.learning_starts = {})",
                    steps, first, task.mpc.learning_starts));
  }
}

}  // namespace slalom::sweep
