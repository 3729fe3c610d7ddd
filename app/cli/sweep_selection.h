#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

#include "app/sweep/cell.h"
#include "app/sweep/plan.h"

namespace slalom::cli {

/// Where sweeps lie without --output.
inline constexpr char kSweepStore[] = "runs/sweeps";

/// The options of the commands `slalom sweep ...`, each of which has some of them.
struct SweepOptions {
  std::string plan;
  std::string list;  ///< The file with `sweep.plans` that names `plan`; empty: there is none.
  std::vector<std::string> overrides;
  std::string store = kSweepStore;
  std::vector<std::string> groups;
  std::vector<std::string> ids;
  std::string shard;
  std::string engine = "local";
  int at_once = 0;
  int threads = 0;
  std::string metrics;
  std::string archive;
  std::vector<std::string> pages;
  bool no_trial = false;
  bool retry_failed = false;
};

/// Adds the options with which every command chooses a plan and some of its cells.
void AddPlanOptions(CLI::App& command, SweepOptions& options);

/// The options for each plan that the file `options.plan` asks for: itself, or those that it lists.
/// Throws `base::Error` like `sweep::PlanFiles`.
std::vector<SweepOptions> EachPlan(const SweepOptions& options);

/// A plan with its cells, and those that the options choose.
struct Sweep {
  sweep::Plan plan;
  sweep::Cells all;
  std::vector<sweep::Cell> chosen;  ///< In the order in which they are worked on.
};

/// Reads the plan, with the errors of `sweep::ReadPlan` and `sweep::ExpandPlan`, and takes up its
/// committed results (`sweep.results`) as `sweep::ImportCells` does. Throws
/// `base::Error`, too, if an option names a group or cell that the plan does not have.
Sweep LoadSweep(const SweepOptions& options);

}  // namespace slalom::cli
