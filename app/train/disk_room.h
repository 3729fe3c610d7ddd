#pragma once

#include <cstdint>

#include "app/train/run_config.h"
#include "learner/run/run_directory.h"

/// Checks that the disk of a run has room for its checkpoints.

namespace slalom::train {

/// Bytes that the replay data of a run's checkpoints take at their peak: when the next one is
/// written beside the two that are kept. The number of rows that they share depends on the steps
/// between them, and the rows of a run depend on its steps. Neither is known beforehand for runs
/// that end or are saved by the clock.
struct ReplayBytes {
  std::int64_t least = 0;  ///< Bytes that are needed at any speed.
  std::int64_t most = 0;
};
ReplayBytes CheckpointReplayBytes(const RunConfig& config);

/// Throws `base::Error` that names need, room and keys if the disk at `directory`, which need not
/// exist, certainly has no room for the checkpoints of a run; warns if it may have too little. The
/// space of checkpoints that the run already has there counts as room. `learner_bytes`: bytes of
/// the learner in one checkpoint. Does nothing if the system does not tell the room.
void RequireRoom(const RunConfig& config, const run::RunDirectory& directory,
                 std::int64_t learner_bytes);

}  // namespace slalom::train
