#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "app/train/run_config.h"

/// What the limits of a run allow, and what to change where they allow too little. An "override" is
/// a text `section.key=value`, as `--set` takes it.

namespace slalom::train {

/// Throws `base::Error` that names the keys where a new run certainly learns nothing: it ends by
/// `run.max_steps` before its first update, or its replay cannot hold what one update samples.
void RequireLearnable(const RunConfig& config);

/// The override with which a run that ended at its limit goes on for about as long again.
std::string LongerLimit(const RunConfig& config, std::int64_t steps, double training_s);

/// Why a run that ended at its limit after `steps` steps made no update, and the override with
/// which it goes on to make some.
struct NothingLearned {
  std::string reason;    ///< A sentence without its full stop.
  std::string override;  ///< As `LongerLimit` gives it.
};
NothingLearned ExplainNoUpdate(const RunConfig& config, std::int64_t steps, double training_s);

/// The overrides that a deterministic run of this config needs besides, all of them. Empty: none.
/// The run must end by steps, since what it learns in some seconds depends on the machine.
std::vector<std::string> OverridesForDeterminism(const RunConfig& config);

}  // namespace slalom::train
