#pragma once

#include <chrono>
#include <filesystem>
#include <string>

#include "app/sweep/cell.h"
#include "app/sweep/claim.h"
#include "app/train/run_identity.h"

/// What a plan's last `sweep run` was, in ROOT/plans/NAME/.

namespace slalom::sweep {

/// Records that this program works on the plan: plan.toml (as resolved) and sweep.json (its cells,
/// the platform and the program). Throws `base::Error` if workers of another version or, unless the
/// plan mixes platforms, of another platform work on its cells now, since their results could not
/// be put beside each other. Before that it watches for `patience` whether claimed cells are worked
/// on, or were left by workers that have died.
void BeginPlan(const std::filesystem::path& store, const Plan& plan, const Cells& cells,
               const train::Platform& platform, const std::string& commit,
               std::chrono::seconds patience = Claim::kExpiry);

/// How many cells of the plan's last run are none of these: the plan, the program or the platform
/// has changed. Returns 0 if it was never run.
int CountStale(const std::filesystem::path& store, const Plan& plan, const Cells& cells);

}  // namespace slalom::sweep
