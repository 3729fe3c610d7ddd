#pragma once

#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "app/sweep/cell.h"
#include "app/sweep/claim.h"

namespace slalom::sweep {

/// What a worker needs to work on any cell.
struct WorkOptions {
  std::filesystem::path store;
  std::filesystem::path program;  ///< `slalom` itself, which trains and scores as a child.
  std::string commit{};           ///< Of it.
  std::string platform{};         ///< `train::Describe` of this machine.
  int at_once = 1;                ///< Cells that this worker works on at the same time.
  int threads = 1;                ///< That a child may use.
  std::vector<int> cores{};       ///< Processors that children are pinned to; empty: none.
};

enum class WorkEnd {
  kDone,     ///< Trained, and every score is there.
  kFailed,   ///< Given up after three attempts; failed.json says why.
  kStopped,  ///< On request; a training was saved.
  kLost,     ///< Somebody else took the cell.
};

/// Does what is left to do of a cell: trains it, from its newest checkpoint if there is one, then
/// makes the scores that are missing. What is finished is kept, so this may be killed at any moment
/// and called again. Checkpoints are removed once the training is finished.
///
/// A run whose files cannot be looked at stays as it is, and the attempt has failed. A failed
/// attempt is repeated twice, unless the training diverged or learned nothing in lockstep: it would
/// do the same again. Throws `base::Error` if the cell's own files cannot be written.
WorkEnd WorkOnCell(const Cell& cell, const WorkOptions& options, Claim& claim,
                   const std::stop_token& stop);

}  // namespace slalom::sweep
