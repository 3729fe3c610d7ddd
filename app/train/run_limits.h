#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "app/train/run_config.h"

/// A run's limits, and overrides that change them. An "override" is a text
/// `section.key=value`, as `--set` takes it.

namespace slalom::train {

/// Environment steps by which a run's first update is due.
std::int64_t FirstUpdate(const RunConfig& config);

/// The override with which a run that ended at its limit continues for about as long again.
std::string LongerLimit(const RunConfig& config, std::int64_t steps, double training_s);

/// The reason why a run that ended at its limit after `steps` steps made no update, and the
/// override with which it continues and makes some.
struct NothingLearned {
  std::string reason;    ///< A sentence without its full stop.
  std::string override;  ///< As `LongerLimit` gives it.
};
NothingLearned ExplainNoUpdate(const RunConfig& config, std::int64_t steps, double training_s);

/// All further overrides that a deterministic run of this config needs; empty if none. The run must
/// end by steps, because its progress per second depends on the machine.
std::vector<std::string> OverridesForDeterminism(const RunConfig& config);

}  // namespace slalom::train
