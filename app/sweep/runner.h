#pragma once

#include <functional>
#include <span>
#include <stop_token>
#include <vector>

#include "app/sweep/cell_work.h"
#include "app/sweep/plan.h"

namespace slalom::sweep {

/// The division of a machine's processors among cells.
struct Slots {
  int at_once = 1;           ///< Cells at the same time.
  int threads = 1;           ///< Threads of each cell.
  std::vector<int> cores{};  ///< Processors of this machine.
  bool pinned = false;       ///< Each cell keeps to its own cores.
};

/// Divides the cores. If `at_once` is 0, there are as many cells as cores in lockstep, and half as
/// many if trainings use threads. Cells are pinned if together they use the whole machine; a worker
/// that was told to run fewer may have others beside it.
Slots ShareOut(const std::vector<int>& cores, int at_once, bool lockstep);

/// The result of a worker's cells.
struct SweepEnd {
  int num_done = 0;
  int num_failed = 0;
  int num_left = 0;      ///< Cells that were not done when the worker was stopped.
  bool stopped = false;  ///< Whether the worker was stopped on request.
};

/// Works on cells until each is done or has failed. Waits for cells that other workers hold, and
/// takes them over if those workers die. Shows progress on standard error: cells done, running and
/// failed, time left, and the scores of each cell as it is done. `on_done` is called after each
/// cell, by the calling thread. Throws `base::Error` if the store cannot be written.
SweepEnd RunCells(std::span<const Cell> cells, const WorkOptions& options, const Slots& slots,
                  const std::stop_token& stop, const std::function<void()>& on_done);

}  // namespace slalom::sweep
