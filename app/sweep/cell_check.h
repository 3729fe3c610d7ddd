#pragma once

#include <cstdint>
#include <vector>

#include "app/train/run_config.h"

namespace slalom::sweep {

/// The environment steps after which a training of this config has made so many updates.
std::int64_t StepsForUpdates(const train::RunConfig& config, std::int64_t updates);

/// Throws `base::Error` where `slalom evaluate` would refuse the policy of a training once it is
/// over: what the task shows or lets it do is not what it was trained with, or it cannot plan yet.
/// `snapshots`: steps at which policies are scored, too.
void RequireScorable(const train::RunConfig& trained, const train::RunConfig& task,
                     const std::vector<int>& snapshots);

}  // namespace slalom::sweep
