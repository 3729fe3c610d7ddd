#pragma once

#include <chrono>
#include <filesystem>
#include <string>

#include "app/sweep/cell.h"
#include "app/sweep/claim.h"
#include "app/train/run_identity.h"

/// The record of a plan's last `sweep run`, in ROOT/plans/NAME/.

namespace slalom::sweep {

/// Records that this program works on the plan: plan.toml (as resolved) and sweep.json (its cells,
/// the platform and the program). Throws `base::Error` if workers of another version or, unless the
/// plan mixes platforms, of another platform work on its cells now, because their results could not
/// be compared. Before that it watches claimed cells for `patience`, to see whether their workers
/// are alive.
void BeginPlan(const std::filesystem::path& store, const Plan& plan, const Cells& cells,
               const train::Platform& platform, const std::string& commit,
               std::chrono::seconds patience = Claim::kExpiry);

/// Counts the cells of the plan's last run that are not among `cells`, because the plan, the
/// program or the platform has changed. Returns 0 if it was never run.
int CountStale(const std::filesystem::path& store, const Plan& plan, const Cells& cells);

}  // namespace slalom::sweep
