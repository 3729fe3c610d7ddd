#pragma once

#include <functional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "app/sweep/cell_work.h"
#include "app/sweep/plan.h"

namespace slalom::sweep {

/// How the work on one machine is shared out.
struct Slots {
  int at_once = 1;           ///< Cells at the same time.
  int threads = 1;           ///< For each.
  std::vector<int> cores{};  ///< Of this machine.
  bool pinned = false;       ///< Each cell keeps to its own cores.
};

/// `at_once`: 0: as many as there are cores in lockstep, half as many if trainings use threads.
/// Cells are pinned where together they use the whole machine: a worker that was told to run fewer
/// may have others beside it.
Slots ShareOut(const std::vector<int>& cores, int at_once, bool lockstep);

/// What became of the cells that a worker was to do.
struct SweepEnd {
  int num_done = 0;
  int num_failed = 0;
  int num_left = 0;      ///< The worker was stopped before they were done.
  bool stopped = false;  ///< On request.
};

/// Works on cells until each is done or has failed, whoever does it: those that others hold are
/// waited for, and taken over if their workers die. Shows progress on standard error: cells done,
/// running and failed, time left, and the scores of each cell as it is done. `on_done` is called
/// after each, from the thread that called this. Throws `base::Error` if the store cannot be
/// written.
SweepEnd RunCells(std::span<const Cell> cells, const WorkOptions& options, const Slots& slots,
                  const std::stop_token& stop, const std::function<void()>& on_done);

}  // namespace slalom::sweep
