#include "app/cli/sweep_selection.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "app/sweep/cell_archive.h"
#include "app/train/run_identity.h"
#include "base/error.h"
#include "base/file.h"
#include "base/name.h"

namespace slalom::cli {
namespace {

std::pair<std::size_t, std::size_t> ParseShard(const std::string& text) {
  unsigned long part = 0;
  unsigned long parts = 0;
  char end = 0;
  base::ThrowIf(
      std::sscanf(text.c_str(), "%lu/%lu%c", &part, &parts, &end) != 2 || part < 1 || part > parts,
      "--shard {}: expected PART/PARTS with PART from 1 to PARTS, such as 1/4", text);
  return {part, parts};
}

/// The first seed of every row before the second one, so that the whole picture shows early.
std::vector<sweep::Cell> BySeed(const sweep::Plan& plan, const std::vector<sweep::Cell>& cells) {
  std::vector<sweep::Cell> sorted = cells;
  const auto place = [&plan](const sweep::Cell& cell) {
    return std::ranges::find(plan.sweep.seeds, cell.seed) - plan.sweep.seeds.begin();
  };
  std::ranges::stable_sort(
      sorted, {}, [&](const sweep::Cell& cell) { return cell.planner.empty() ? place(cell) : 0; });
  return sorted;
}

std::vector<sweep::Cell> Choose(const SweepOptions& options, const sweep::Plan& plan,
                                const std::vector<sweep::Cell>& cells) {
  std::vector<std::string> names;
  for (const sweep::Group& group : plan.groups) names.push_back(group.name);
  for (const std::string& group : options.groups) {
    if (std::ranges::find(names, group) != names.end()) continue;
    throw base::Error("--only {}: {} has no such group, expected one of {}{}", group, options.plan,
                      fmt::join(names, ", "), base::Suggestion(group, names));
  }
  for (const std::string& id : options.ids) {
    if (std::ranges::find(cells, id, &sweep::Cell::id) != cells.end()) continue;
    throw base::Error(
        "--cell {}: {} has no such cell here ({}); was it planned by another version of slalom or "
        "on another class of processor?",
        id, options.plan, train::Describe(train::ThisPlatform()));
  }
  const auto [part, parts] =
      options.shard.empty() ? std::pair<std::size_t, std::size_t>{1, 1} : ParseShard(options.shard);
  std::vector<sweep::Cell> chosen;
  const std::vector<sweep::Cell> sorted = BySeed(plan, cells);
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    const bool in_group =
        options.groups.empty() ||
        std::ranges::find(options.groups, sorted[i].group) != options.groups.end();
    const bool is_named =
        options.ids.empty() || std::ranges::find(options.ids, sorted[i].id) != options.ids.end();
    if (in_group && is_named && i % parts == part - 1) chosen.push_back(sorted[i]);
  }
  return chosen;
}

}  // namespace

std::vector<SweepOptions> EachPlan(const SweepOptions& options) {
  const std::vector<std::filesystem::path> files = sweep::PlanFiles(options.plan);
  if (files.size() == 1 && files.front() == options.plan) return {options};
  for (const std::string& set : options.overrides) {
    if (!set.starts_with("sweep.name=")) continue;
    throw base::Error(
        "--set {}: {} lists several plans, whose reports would lie in one place; use --output", set,
        options.plan);
  }
  std::vector<SweepOptions> each;
  for (const std::filesystem::path& file : files) {
    each.push_back(options);
    each.back().list = options.plan;
    each.back().plan = file.string();
  }
  return each;
}

Sweep LoadSweep(const SweepOptions& options) {
  Sweep sweep;
  sweep.plan = sweep::ReadPlan(options.plan, options.overrides);
  sweep.all = sweep::ExpandPlan(sweep.plan, train::ThisPlatform());
  if (const std::string& results = sweep.plan.sweep.results; !results.empty()) {
    const std::filesystem::path archive = sweep.plan.file.parent_path() / results;
    if (base::Exists(archive)) sweep::ImportCells(archive, options.store, sweep.all.cells);
  }
  sweep.chosen = Choose(options, sweep.plan, sweep.all.cells);
  return sweep;
}

void AddPlanOptions(CLI::App& command, SweepOptions& options) {
  command.add_option("PLAN", options.plan, "TOML file of the sweep (configs/sweeps has some)")
      ->required();
  command
      .add_option("--set", options.overrides,
                  "Override a key of the plan ([sweep], [budget], [slurm]), or of the config of "
                  "every training (repeatable)")
      ->type_name("KEY=VALUE");
  command.add_option("--output", options.store,
                     "Directory of all sweeps, which share their cells [runs/sweeps]");
  command.add_option("--only", options.groups, "Only cells of this group (repeatable)")
      ->type_name("GROUP");
  command.add_option("--cell", options.ids, "Only the cell of this id (repeatable)")
      ->type_name("ID");
  command.add_option("--shard", options.shard, "Only one part of the cells, such as 1/4")
      ->type_name("PART/PARTS");
  command
      .add_option("--at-once", options.at_once,
                  "Cells at the same time [one per core; half as many if trainings use threads]")
      ->check(CLI::Range(0, 4096));
}

}  // namespace slalom::cli
