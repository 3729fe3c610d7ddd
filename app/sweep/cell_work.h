#pragma once

#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "app/sweep/cell.h"
#include "app/sweep/claim.h"

namespace slalom::sweep {

/// Options of a worker, the same for all cells.
struct WorkOptions {
  std::filesystem::path store;
  std::filesystem::path program;  ///< `slalom` itself, which trains and scores as a child.
  std::string commit{};           ///< Commit of the program.
  std::string platform{};         ///< `train::Describe` of this machine.
  int at_once = 1;                ///< Cells that this worker works on at the same time.
  int threads = 1;                ///< Threads of a child.
  std::vector<int> cores{};       ///< Processors that children are pinned to; empty for no pinning.
};

enum class WorkEnd {
  kDone,     ///< Trained, and every score is there.
  kFailed,   ///< Given up after three attempts; failed.json says why.
  kStopped,  ///< On request; a training was saved.
  kLost,     ///< Another worker took the cell.
};

/// Does the remaining work of a cell: trains it, from its newest checkpoint if there is one, then
/// makes the missing scores. Finished parts are kept, so this may be killed at any moment and
/// called again. Checkpoints are removed once the training is finished.
///
/// A run whose files cannot be looked at stays as it is, and the attempt has failed. A failed
/// attempt is repeated twice, unless the training diverged or learned nothing in lockstep: it would
/// do the same again. Throws `base::Error` if the cell's own files cannot be written.
WorkEnd WorkOnCell(const Cell& cell, const WorkOptions& options, Claim& claim,
                   const std::stop_token& stop);

}  // namespace slalom::sweep
