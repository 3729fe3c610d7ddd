#pragma once

#include <cstdint>
#include <vector>

#include "app/train/run_config.h"

namespace slalom::sweep {

/// The environment steps after which a training of this config has made `updates` updates.
std::int64_t StepsForUpdates(const train::RunConfig& config, std::int64_t updates);

/// Throws `base::Error` if `slalom evaluate` would refuse the policy of the finished training:
/// because the task has other observations or actions than the training, or because the policy
/// cannot plan yet. `snapshots`: steps at which policies are scored, too.
void RequireScorable(const train::RunConfig& trained, const train::RunConfig& task,
                     const std::vector<int>& snapshots);

}  // namespace slalom::sweep
