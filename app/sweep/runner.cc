#include "app/sweep/runner.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "app/sweep/estimate.h"
#include "app/sweep/store.h"
#include "app/train/resolved_run.h"
#include "base/error.h"
#include "base/log.h"
#include "base/machine.h"
#include "base/progress.h"
#include "eval/report/result.h"

namespace slalom::sweep {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kLookAgain{2};  // For cells that others hold.

/// "test 93.4 %, training courses 98.1 %": the success of a cell's scores.
std::string Scores(const std::filesystem::path& store, const Cell& cell) {
  std::vector<std::string> texts;
  for (const ScoreTask& task : cell.scores) {
    if (task.snapshot_steps > 0) continue;
    std::ifstream file(CellDirectory(store, cell.id).score(task) / eval::kEvaluationFile);
    const auto json = nlohmann::json::parse(file, nullptr, false);
    if (!json.is_object() || !json.contains("success_rate")) continue;
    texts.push_back(
        fmt::format("{} {:.1f} %", task.name, 100.0 * json["success_rate"].get<double>()));
  }
  return fmt::format("{}", fmt::join(texts, ", "));
}

/// The state that the slots of a worker share.
class Worker {
 public:
  Worker(std::span<const Cell> cells, const WorkOptions& options, const Slots& slots,
         const std::stop_token& stop)
      : cells_(cells), options_(options), slots_(slots), stop_(stop), ends_(cells.size()) {
    working_.resize(static_cast<std::size_t>(slots.at_once));
    NoteWhatEndedBefore();
  }

  SweepEnd Run(const std::function<void()>& on_done) {
    std::vector<std::jthread> threads;
    threads.reserve(static_cast<std::size_t>(slots_.at_once));
    for (int slot = 0; slot < slots_.at_once; ++slot) {
      try {
        threads.push_back(
            base::StartThread("a cell of the sweep", [this, slot] { RunSlot(slot); }));
      } catch (const base::Error& error) {
        Fail(error);
        const std::scoped_lock lock(mutex_);
        num_ended_ += slots_.at_once - slot;
        break;
      }
    }
    ShowProgress(on_done);
    threads.clear();
    if (!error_.empty()) throw base::Error(error_);
    SweepEnd end;
    end.stopped = stop_.stop_requested();
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      const bool done = ends_[i] == WorkEnd::kDone || IsDone(options_.store, cells_[i]);
      const bool failed = !done && ends_[i] == WorkEnd::kFailed;
      ++(done ? end.num_done : failed ? end.num_failed : end.num_left);
    }
    return end;
  }

 private:
  void NoteWhatEndedBefore() {
    int num_done = 0;
    int num_failed = 0;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      if (!EndedElsewhere(i)) continue;
      ++(ends_[i] == WorkEnd::kDone ? num_done : num_failed);
      rates_.Observe(cells_[i], ReadCellStatus(options_.store, cells_[i]));
    }
    changed_cells_.clear();
    if (num_done > 0) spdlog::info("{} cells were done before", num_done);
    if (num_failed > 0) spdlog::warn("{} cells have failed before", num_failed);
  }

  void Fail(const std::exception& error) {
    spdlog::error("{}; this worker ends once its other cells have", error.what());
    const std::scoped_lock lock(mutex_);
    if (error_.empty()) error_ = error.what();
  }

  struct Taken {
    std::size_t index = 0;
    std::unique_ptr<Claim> claim;
  };

  void RunSlot(int slot) {
    WorkOptions options = options_;
    options.at_once = slots_.at_once;
    options.threads = slots_.threads;
    if (slots_.pinned) {
      const auto first = slots_.cores.begin() + std::ptrdiff_t{slot} * slots_.threads;
      options.cores.assign(first, first + slots_.threads);
    }
    try {
      while (const auto taken = Take(slot)) {
        const Cell& cell = cells_[taken->index];
        const WorkEnd end = WorkOnCell(cell, options, *taken->claim, stop_);
        std::unique_lock lock(mutex_);
        working_[static_cast<std::size_t>(slot)].reset();
        if (end == WorkEnd::kDone || end == WorkEnd::kFailed) {
          ends_[taken->index] = end;
          changed_cells_.push_back(taken->index);
        } else if (end == WorkEnd::kLost) {
          spdlog::warn("{}: another worker has it, or still writes to it", cell.name());
          changed_.wait_for(lock, kLookAgain);
        }
        changed_.notify_all();
      }
    } catch (const std::exception& error) {
      Fail(error);
    }
    const std::scoped_lock lock(mutex_);
    ++num_ended_;
    changed_.notify_all();
  }

  /// The next cell to work on; none: nothing is left to do. Waits while others hold all that is
  /// left.
  std::optional<Taken> Take(int slot) {
    std::unique_lock lock(mutex_);
    for (;;) {
      if (stop_.stop_requested() || !error_.empty()) return std::nullopt;
      bool is_left = false;
      for (std::size_t i = 0; i < cells_.size(); ++i) {
        if (ends_[i] || IsWorkedOn(i)) continue;
        if (EndedElsewhere(i)) continue;
        is_left = true;
        auto claim = taker_.Try(CellDirectory(options_.store, cells_[i].id).root());
        if (!claim) continue;
        // It may have been finished between the look and the claim.
        if (EndedElsewhere(i)) continue;
        working_[static_cast<std::size_t>(slot)] = i;
        return Taken{i, std::move(claim)};
      }
      if (!is_left) return std::nullopt;
      changed_.wait_for(lock, kLookAgain);
    }
  }

  bool IsWorkedOn(std::size_t index) const {
    return std::ranges::find(working_, std::optional(index)) != working_.end();
  }

  /// Whether a cell is done, or another worker gave it up; takes note of it.
  bool EndedElsewhere(std::size_t index) {
    std::error_code ec;
    if (IsDone(options_.store, cells_[index])) {
      ends_[index] = WorkEnd::kDone;
    } else if (std::filesystem::exists(CellDirectory(options_.store, cells_[index].id).failed(),
                                       ec)) {
      ends_[index] = WorkEnd::kFailed;
    } else {
      return false;
    }
    changed_cells_.push_back(index);
    return true;
  }

  void ShowProgress(const std::function<void()>& on_done) {
    base::ProgressLine progress;
    const Clock::time_point begin = Clock::now();
    for (bool ended = false; !ended;) {
      std::vector<std::size_t> changed;
      {
        std::unique_lock lock(mutex_);
        changed_.wait_for(lock, std::chrono::milliseconds(500));
        changed.swap(changed_cells_);
        ended = num_ended_ == slots_.at_once;
      }
      if (!changed.empty()) progress.End();
      for (const std::size_t index : changed) LogResult(index);
      if (!changed.empty()) on_done();
      if (!ended) {
        progress.Show(Line(), std::chrono::duration<double>(Clock::now() - begin).count());
      }
    }
    progress.End();
  }

  void LogResult(std::size_t index) {
    const Cell& cell = cells_[index];
    const CellStatus status = ReadCellStatus(options_.store, cell);
    rates_.Observe(cell, status);
    if (status.state == CellState::kDone) {
      spdlog::info("{} done: {}", cell.name(), Scores(options_.store, cell));
    } else if (status.failure) {
      spdlog::error("{} failed: {}; the end of {}:\n{}", cell.name(), status.failure->what,
                    CellDirectory(options_.store, cell.id).log().string(), status.failure->log);
    }
  }

  std::string Line() {
    int num_done = 0;
    int num_failed = 0;
    double left_s = 0.0;
    bool knows_left = true;
    std::vector<std::string> running;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      std::optional<WorkEnd> end;
      bool is_here = false;
      {
        const std::scoped_lock lock(mutex_);
        end = ends_[i];
        is_here = IsWorkedOn(i);
      }
      if (end) {
        ++(*end == WorkEnd::kDone ? num_done : num_failed);
        continue;
      }
      CellStatus status;
      if (is_here) {
        status = ReadCellStatus(options_.store, cells_[i]);
        running.push_back(StatusText(cells_[i], status));
      }
      const auto seconds = rates_.SecondsLeft(cells_[i], status.steps, status.num_scores_done);
      left_s += seconds.value_or(0.0);
      knows_left = knows_left && seconds.has_value();
    }
    const int num_left = static_cast<int>(cells_.size()) - num_done - num_failed;
    std::string text =
        fmt::format("{} of {} cells done, {} running", num_done, cells_.size(), running.size());
    if (num_failed > 0) text += fmt::format(", {} failed", num_failed);
    if (knows_left) {
      const double wall_s = WallSeconds(left_s, num_left, slots_.at_once);
      text += fmt::format(", {} left", base::FormatDuration(wall_s));
    }
    if (!running.empty()) text += fmt::format(" | {}", fmt::join(running, "; "));
    return text;
  }

  static std::string StatusText(const Cell& cell, const CellStatus& status) {
    if (status.state == CellState::kScoring || !cell.config) {
      const int num_scores = static_cast<int>(cell.scores.size());
      return fmt::format("{}: score {} of {}", cell.name(),
                         std::min(status.num_scores_done + 1, num_scores), num_scores);
    }
    return fmt::format("{}: {} of {} steps", cell.name(),
                       base::FormatCount(static_cast<double>(status.steps)),
                       base::FormatCount(static_cast<double>(train::MaxStepsOf(*cell.config))));
  }

  const std::span<const Cell> cells_;
  const WorkOptions& options_;
  const Slots& slots_;
  const std::stop_token stop_;
  Rates rates_;  // Used by the thread that shows progress.

  std::mutex mutex_;
  std::condition_variable changed_;
  ClaimTaker taker_;
  std::vector<std::optional<WorkEnd>> ends_;         // By cell; none: not ended.
  std::vector<std::optional<std::size_t>> working_;  // By slot.
  std::vector<std::size_t> changed_cells_;           // Cells that ended and were not told of.
  int num_ended_ = 0;                                // Slots.
  std::string error_;                                // Which ends the worker.
};

}  // namespace

Slots ShareOut(const std::vector<int>& cores, int at_once, bool lockstep) {
  const int num_cores = static_cast<int>(cores.size());
  Slots slots;
  slots.cores = cores;
  slots.at_once = at_once > 0 ? at_once : std::max(1, lockstep ? num_cores : num_cores / 2);
  slots.threads = std::max(1, num_cores / slots.at_once);
  const bool fills_machine = slots.at_once * slots.threads == num_cores;
  slots.pinned = fills_machine && (at_once == 0 || at_once == num_cores);
  return slots;
}

SweepEnd RunCells(std::span<const Cell> cells, const WorkOptions& options, const Slots& slots,
                  const std::stop_token& stop, const std::function<void()>& on_done) {
  return Worker(cells, options, slots, stop).Run(on_done);
}

}  // namespace slalom::sweep
