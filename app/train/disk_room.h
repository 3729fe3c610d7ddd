#pragma once

#include <cstdint>

#include "app/train/run_config.h"
#include "learner/run/run_directory.h"

/// Whether the disk of a run has room for its checkpoints.

namespace slalom::train {

/// Bytes that the replay data of a run's checkpoints take at their peak: when the next one is
/// written beside the two that are kept. How many rows they share depends on the steps between
/// them, and the rows of a run on its steps; neither is known beforehand of what ends or is saved
/// by the clock.
struct ReplayBytes {
  std::int64_t least = 0;  ///< That are needed whatever the speed.
  std::int64_t most = 0;
};
ReplayBytes CheckpointReplayBytes(const RunConfig& config);

/// Throws `base::Error` that names need, room and keys if the disk at `directory`, which need not
/// exist, certainly has no room for the checkpoints of a run; warns if it may have too little. What
/// the run's checkpoints take there already counts as room. `learner_bytes`: of the learner in one
/// checkpoint. If the room cannot be found out, nothing is said.
void RequireRoom(const RunConfig& config, const run::RunDirectory& directory,
                 std::int64_t learner_bytes);

}  // namespace slalom::train
