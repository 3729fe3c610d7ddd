#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/config_field.h"
#include "sim/engines/physics.h"

/// The plan of a sweep, as its TOML file has it (docs/sweeps.md). Its cells are in
/// app/sweep/cell.h.

namespace slalom::sweep {

/// The quantities that a plan can name: all means of `eval::Quantities`.
base::OneOf QuantityKeys();

/// Those of a plan that names none.
inline constexpr std::array<std::string_view, 4> kUsualQuantities = {
    "success_rate", "collision_rate", "survival_time_s", "traversal_time_s"};

inline base::OneOf PhysicsNames() {
  base::OneOf names{};
  for (const engines::PhysicsInfo& info : engines::KnownPhysics())
    names.choices.push_back(info.name);
  return names;
}

/// The command that trains a cell.
enum class Trainer { kProcess, kService };
inline base::OneOf EnumNames(Trainer) { return {"process", "service"}; }

/// Settings that all cells share.
struct SweepSettings {
  std::string name;
  std::string title;
  std::vector<std::string> plans;
  std::string preset;
  std::vector<int> seeds = {1, 2, 3};
  std::vector<std::string> scores;
  std::vector<std::string> quantities;
  Trainer trainer = Trainer::kProcess;
  int actors = 2;
  bool lockstep = true;
  bool mixed_platforms = false;
  std::int64_t checkpoint_steps = 100000;
  std::string results;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("name", name,
      "Name of the sweep: a directory below --output holds its report. Empty: that of the file.");
    v("title", title, "Title of the report. Empty: the name.");
    v("plans", plans,
      "Plans to work on one after the other, as paths relative to this file, which then holds "
      "nothing else. Empty: this file is a plan itself.");
    v("preset", preset,
      "Config from which trainings start, as a path relative to this file. A group may have its "
      "own.");
    v("seeds", seeds, base::Range{0, 2.0e9}, "",
      "Each combination of the axes is trained once with each of these seeds (run.seed).");
    v("scores", scores,
      "Names of the scores for groups that list none. Empty: all. With --set, a plan can "
      "thus be scored on validation courses in place of the test courses.");
    v("quantities", quantities,
      "Quantities, as a [[conclusion]] names them, that have a table each, with the scores side by "
      "side. Empty: the rates of success and collision and both times, and with one axis a table "
      "per score.");
    v("trainer", trainer,
      "What trains a cell. process: one `slalom train`. service: a replay server, a learner and "
      "sweep.actors actors of its own, which are never in lockstep.");
    v("actors", actors, base::Range{1, 1000}, "",
      "Actors of each cell with sweep.trainer = \"service\".");
    v("lockstep", lockstep,
      "Train deterministically (run.deterministic), so that neither a kill nor another cell on the "
      "same machine changes a result. false: trainings use threads. With sweep.trainer = "
      "\"service\" the default is false.");
    v("mixed_platforms", mixed_platforms,
      "Let machines with other processors or BLAS kernels take part, whose results differ in their "
      "last bits. false: such a machine refuses to.");
    v("checkpoint_steps", checkpoint_steps, base::Range{1, 1.0e12}, "",
      "Environment steps between checkpoints of a cell, where the preset has none "
      "(run.checkpoint_steps).");
    v("results", results,
      "Archive, relative to this file, with committed results of cells (`slalom sweep export`), "
      "which count as done. Empty: there is none.");
  }
};

/// How long a training lasts. At most one of the three is set; if none is, the preset's limits
/// hold.
struct BudgetSettings {
  std::int64_t steps = 0;
  std::int64_t updates = 0;
  double seconds = 0.0;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("steps", steps, base::Range{0, 1.0e12}, "", "Environment steps. 0: not limited by this key.");
    v("updates", updates, base::Range{0, 1.0e12}, "",
      "Updates, turned into environment steps by run.updates_per_step and run.learning_starts. 0: "
      "not limited by this key.");
    v("seconds", seconds, base::Range{0.0, 1.0e7}, "s",
      "Training time. Needs sweep.lockstep = false, since what is learned in a second depends on "
      "the machine. 0: not limited by this key.");
  }
};

/// A list of settings, each of which is combined with every setting of the other axes.
struct Axis {
  std::string name;
  std::vector<std::string> keys;
  std::vector<base::TomlValue> values;
  std::vector<std::string> labels;
  std::vector<int> num_seeds;
  bool columns = false;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("name", name, "What varies, in words, for tables and figures. Empty: the first key.");
    v("keys", keys,
      "Keys of the config that this axis sets. More than one change together, value by value.");
    v("values", values,
      "The values of the key, or where there are several keys a list with one value for each.");
    v("labels", labels,
      "What to call each value in tables. If all labels are numbers, the report plots success over "
      "them. Empty: the values themselves.");
    v("num_seeds", num_seeds, base::Range{1, 1e6}, "",
      "With how many of the seeds, from the first on, each value is trained. Empty: with all.");
    v("columns", columns,
      "Show this axis of the plan side by side: tables have one row for all its values, and each "
      "score says by score.column which value it is of. At most one axis.");
  }
};

/// Cells that belong together: one training setup over its axes, or a classical planner.
struct Group {
  std::string name;
  std::string label;
  std::string preset;
  std::string planner;
  std::vector<std::string> profiles;
  base::TomlAssignments set;
  std::vector<std::string> scores;
  std::vector<Axis> axes;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("name", name, "Name for --only: letters, digits, '-' and '_'.");
    v("label", label, "What to call it in tables. Empty: the name.");
    v("preset", preset,
      "Config to start from in place of sweep.preset. For a planner, the task that it drives; "
      "empty: the default task.");
    v("planner", planner,
      "A classical planner (dwa, teb, eband, mppi), which is scored without training and has no "
      "seeds. Empty: policies are trained.");
    v("profiles", profiles,
      "TOML files, as paths relative to the plan, whose [environment] is laid over the preset's.");
    v("set", set, "Keys of the config and their values, for this group.");
    v("scores", scores, "Names of the scores for this group. Empty: sweep.scores.");
    v.Tables("axis", axes, "An axis of this group, besides those of the plan.");
  }
};

/// Courses on which each trained policy or planner is scored, and how.
struct Score {
  std::string name;
  std::string label;
  std::string column;
  std::string courses;
  std::string protocol;
  int episodes = 0;
  std::vector<std::string> profiles;
  base::TomlAssignments set;
  std::string physics = "slalom";
  bool planning = false;
  bool snapshots = false;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("name", name, "Name of the score: letters, digits, '-' and '_'.");
    v("label", label, "What to call it in tables. Empty: the name.");
    v("column", column,
      "Label of the value of the axis with columns = true whose trainings have this score. Empty: "
      "there is no such axis.");
    v("courses", courses,
      "Course set, as `slalom evaluate --courses` takes it. \"training\": the courses that the "
      "cell was trained on.");
    v("protocol", protocol, "evaluation.protocol of this score. Empty: that of the preset.");
    v("episodes", episodes, base::Range{0, 100000}, "",
      "Episodes on each course. 0: that of the preset.");
    v("profiles", profiles,
      "TOML files, as paths relative to the plan, whose [environment] is laid over the task.");
    v("set", set, "Keys of [environment], [evaluation] and [mpc] for this score.");
    v("physics", physics, PhysicsNames(), "",
      "What moves the robot: Slalom's own physics or another engine, if the program is built with "
      "it.");
    v("planning", planning, "Plan with the policy's transition model (mpc.enabled).");
    v("snapshots", snapshots,
      "Score the policies of run.snapshot_steps, too, for curves of sample efficiency.");
  }
};

/// Published numbers to show beside the results.
struct Reference {
  std::string source;
  std::string score;
  std::string quantity = "success_rate";
  std::vector<std::string> rows;
  std::vector<double> values;
  std::vector<double> deviations;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("source", source, "Who published the numbers, in words.");
    v("score", score, "Name of the score that they are compared with.");
    v("quantity", quantity, QuantityKeys(), "",
      "What the numbers are. Rates are shares from 0 to 1.");
    v("rows", rows,
      "The rows of the table that the numbers belong to: labels of group and axes, joined by "
      "\" / \", such as \"GRU / 4\".");
    v("values", values, base::Range{-1e9, 1e9}, "", "One number for each row.");
    v("deviations", deviations, base::Range{0.0, 1e9}, "",
      "Their standard deviations over runs. Empty, or 0: not known.");
  }
};

/// On which side of its limit a conclusion says that a figure lies.
enum class ConclusionKind { kAbove, kBelow, kWithin };
inline base::OneOf EnumNames(ConclusionKind) { return {"above", "below", "within"}; }

/// A sentence about the results that they bear out or not: each row's quantity, or its difference
/// from another row's, lies above or below a limit, or within a limit on both sides of 0.
struct Conclusion {
  std::string text;
  std::string score;
  std::string quantity = "success_rate";
  std::vector<std::string> rows;
  std::vector<std::string> than;
  std::string than_score;
  ConclusionKind kind = ConclusionKind::kAbove;
  double limit = 0.0;

  const std::string& other_score() const { return than_score.empty() ? score : than_score; }

  template <class Visitor>
  void Visit(Visitor& v) {
    v("text", text, "The conclusion, in words.");
    v("score", score, "Name of the score that it is about.");
    v("quantity", quantity, QuantityKeys(), "", "What is compared. Rates are shares from 0 to 1.");
    v("rows", rows,
      "Rows of the table that it speaks of, as in reference.rows. It holds if it holds for each.");
    v("than", than,
      "The row that is subtracted from each of them, or one row for all. Empty: nothing is "
      "subtracted.");
    v("than_score", than_score, "Name of the score of these rows. Empty: that of the others.");
    v("kind", kind,
      "above, below: the whole 95 % interval of the figure must lie on that side of the limit. "
      "within: between minus the limit and the limit.");
    v("limit", limit, base::Range{-1e9, 1e9}, "", "The limit, a share from 0 to 1 for rates.");
  }
};

/// How cells are handed to Slurm (`--engine slurm`).
struct SlurmSettings {
  std::string partition;
  std::string account;
  double hours = 24.0;
  int memory_mb = 4096;
  int at_once = 0;
  std::vector<std::string> options;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("partition", partition, "Partition. Empty: the cluster's default.");
    v("account", account, "Account. Empty: the user's default.");
    v("hours", hours, base::Range{0.01, 10000.0}, "h",
      "Time limit of a task. A cell that needs longer saves itself, is requeued and goes on.");
    v("memory_mb", memory_mb, base::Range{64, 1.0e9}, "MiB", "Memory of a task.");
    v("at_once", at_once, base::Range{0, 100000}, "", "Tasks at the same time. 0: no limit.");
    v("options", options, "Further options of sbatch, one string each.");
  }
};

/// A plan file. A value.
struct Plan {
  SweepSettings sweep;
  BudgetSettings budget;
  base::TomlAssignments set;
  std::vector<Axis> axes;
  std::vector<Group> groups;
  std::vector<Score> scores;
  std::vector<Reference> references;
  std::vector<Conclusion> conclusions;
  SlurmSettings slurm;

  std::filesystem::path file;         ///< File it was read from; paths in it are relative to this.
  base::TomlAssignments overrides{};  ///< `--set` of keys of the run's config, laid over all.

  template <class Visitor>
  void Visit(Visitor& v) {
    v("set", set, "Keys of the config and their values, for every training.");
    v.Section("sweep", sweep, "The sweep as a whole.");
    v.Section("budget", budget, "How long each training lasts.");
    v.Tables("axis", axes, "An axis of every group of trainings.");
    v.Tables("group", groups,
             "Cells that belong together. Without any there is one group, with the sweep's name.");
    v.Tables("score", scores, "What every policy and planner is scored on.");
    v.Tables("reference", references, "Published numbers, shown beside the results.");
    v.Tables("conclusion", conclusions, "Sentences that the report judges by the results.");
    v.Section("slurm", slurm, "How cells are handed to Slurm.");
  }
};

/// The plans that a file asks for: itself, or the files in `sweep.plans`. Throws `base::Error` like
/// `ReadPlan`, and if one of these does not exist or names plans itself.
std::vector<std::filesystem::path> PlanFiles(const std::filesystem::path& file);

/// Reads a plan. `overrides`: `--set` of the command line. Keys of the plan (sweep, budget, slurm)
/// change the plan; any other is a key of the run's config and changes every training. Throws
/// `base::Error` that names file, line and key: unknown key, no score, an empty axis, lists of
/// different lengths, two groups or scores of one name, a preset that is not there, a file with
/// `sweep.plans`.
Plan ReadPlan(const std::filesystem::path& file, std::span<const std::string> overrides);

/// One setting of every axis.
struct Point {
  base::TomlAssignments set;                        ///< Settings of the axes, in their order.
  std::vector<std::string> labels;                  ///< One for each axis.
  int max_seeds = std::numeric_limits<int>::max();  ///< Largest number of seeds.
};

/// The product of the axes, the last one changing fastest. Without any axis, one empty point.
/// Throws `base::Error` that names the place of a value that does not have one element for each of
/// its axis' keys.
std::vector<Point> Product(const std::vector<const Axis*>& axes);

/// Name of an axis in tables.
std::string AxisName(const Axis& axis);

/// Name of each of its values.
std::vector<std::string> AxisLabels(const Axis& axis);

/// The axis with `columns = true`, or null if there is none.
const Axis* ColumnAxis(const Plan& plan);

}  // namespace slalom::sweep
