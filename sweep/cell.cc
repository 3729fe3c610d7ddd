#include "sweep/cell.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <utility>

#include "base/error.h"
#include "base/file.h"
#include "config/config.h"
#include "planners/planner_registry.h"
#include "sim/course_file.h"
#include "sim/course_sets.h"
#include "sweep/axes.h"
#include "train/agent_run_config.h"
#include "train/profile.h"
#include "train/run_limits.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;

/// A course set as far as a cell's identity needs it.
struct CourseFacts {
  int num_courses = 0;
  std::string digest;
};

/// Course sets that were read once.
class Courses {
 public:
  template <class CoursesConfig>
  const CourseFacts& Find(const CoursesConfig& config, const std::string& spec) {
    const std::string key =
        fmt::format("{}\n{}\n{}", config.collection, config.generator_seed, spec);
    auto found = facts_.find(key);
    if (found == facts_.end()) {
      const sim::CourseSet set = sim::ResolveCourses(
          spec, config.collection, static_cast<std::uint64_t>(config.generator_seed));
      found = facts_
                  .emplace(key, CourseFacts{static_cast<int>(set.courses.size()),
                                            train::Digest(sim::PrintCourseSet(set))})
                  .first;
    }
    return found->second;
  }

 private:
  std::map<std::string, CourseFacts> facts_;
};

void Apply(const base::TomlAssignments& set, const config::FieldList& fields) {
  for (const auto& [key, value] : set) config::SetField(key, value.text, value.where, fields);
}

bool Sets(const base::TomlAssignments& set, std::string_view key) {
  return std::ranges::find(set, key, &base::TomlAssignment::key) != set.end();
}

std::int64_t StepsForUpdates(const train::RunConfig& config, std::int64_t updates) {
  return config.run.learning_starts +
         static_cast<std::int64_t>(
             std::ceil(static_cast<double>(updates) / config.run.updates_per_step));
}

/// Turns a plan into cells.
class Expansion {
 public:
  Expansion(const Plan& plan, const train::Platform& platform)
      : plan_(plan),
        platform_(plan.sweep.mixed_platforms
                      ? fmt::format("numerics {}, any machine", platform.numerics)
                      : train::Describe(platform)) {}

  Cells Run() {
    // Heads of tables: the group, if rows differ by it, then the axes.
    const bool names_groups = plan_.groups.size() > 1;
    for (const Group& group : plan_.groups) {
      std::vector<const Axis*> axes;
      if (group.planner.empty()) {
        for (const Axis& axis : plan_.axes) axes.push_back(&axis);
      }
      for (const Axis& axis : group.axes) axes.push_back(&axis);
      if (axes.size() > axis_names_.size()) {
        axis_names_.clear();
        for (const Axis* axis : axes) axis_names_.push_back(AxisName(*axis));
      }
      for (Point& point : Product(axes)) {
        if (names_groups) point.labels.insert(point.labels.begin(), group.label);
        if (group.planner.empty()) {
          AddTrainings(group, point);
        } else {
          AddPlanner(group, point);
        }
      }
    }
    if (names_groups) axis_names_.insert(axis_names_.begin(), "method");
    CheckReferences();
    return {std::move(cells_), std::move(axis_names_)};
  }

 private:
  [[noreturn]] void Fail(const std::string& who, const std::string& what) const {
    throw base::Error(fmt::format("{}: {}: {}", plan_.file.string(), who, what));
  }

  fs::path Beside(const std::string& path) const { return plan_.file.parent_path() / path; }

  const train::RunConfig& Preset(const std::string& preset) {
    auto found = presets_.find(preset);
    if (found == presets_.end()) {
      train::RunConfig config;
      config::ReadTomlFile(Beside(preset), config::ListFields(config));
      found = presets_.emplace(preset, std::move(config)).first;
    }
    return found->second;
  }

  train::RunConfig Configure(const Group& group, const Point& point) {
    train::RunConfig config = Preset(group.preset.empty() ? plan_.sweep.preset : group.preset);
    const config::FieldList fields = config::ListFields(config);
    bool limits_steps = false;
    for (const auto* set : {&plan_.set, &group.set, &point.set, &plan_.overrides}) {
      Apply(*set, fields);
      limits_steps = limits_steps || Sets(*set, "run.max_steps");
      // What the command line says stands above the budget.
      if (set == &point.set) limits_steps = ApplyBudget(config) || limits_steps;
    }
    for (const base::TomlAssignment& override : plan_.overrides) {
      if (!Sets(point.set, override.key)) continue;
      Fail(override.value.where, "the key is an axis of the plan, whose values it would undo");
    }
    if (plan_.budget.seconds > 0.0 && !limits_steps) config.run.max_steps = 1'000'000'000'000;
    if (plan_.sweep.lockstep) {
      if (config.run.max_seconds > 0.0 && !limits_steps) {
        Fail(fmt::format("group '{}'", group.name),
             fmt::format("its preset ends by run.max_seconds = {}, expected budget.steps or "
                         "budget.updates, as a training in lockstep ends by steps",
                         config.run.max_seconds));
      }
      config.run.max_seconds = 0.0;
      config.run.deterministic = true;
      if (config.run.checkpoint_steps == 0) {
        config.run.checkpoint_steps = plan_.sweep.checkpoint_steps;
      }
    }
    // What the sweep itself decides.
    config.run.name = "run";
    config.run.keep_checkpoints = "newest";  // The runner removes it in the end.
    return config;
  }

  /// Returns whether it limits the steps.
  bool ApplyBudget(train::RunConfig& config) const {
    const BudgetSettings& budget = plan_.budget;
    if (budget.seconds > 0.0) config.run.max_seconds = budget.seconds;
    if (budget.steps > 0) config.run.max_steps = budget.steps;
    if (budget.updates > 0) config.run.max_steps = StepsForUpdates(config, budget.updates);
    return budget.steps > 0 || budget.updates > 0;
  }

  void Check(const std::string& who, const train::RunConfig& config) const {
    try {
      train::RequireCombination(config);
      train::RequireLearnable(config);
    } catch (const base::Error& error) {
      Fail(who, error.what());
    }
    if (config.run.deterministic && config.method.learner.prioritized) {
      Fail(who,
           "learner.prioritized is true, expected false in lockstep, as checkpoints do not "
           "hold priorities");
    }
  }

  void AddTrainings(const Group& group, const Point& point) {
    const train::RunConfig resolved = Configure(group, point);
    for (const int seed : plan_.sweep.seeds) {
      Cell cell;
      cell.group = group.name;
      cell.row = point.labels;
      cell.seed = seed;
      train::RunConfig config = resolved;
      config.run.seed = seed;
      const std::string who = cell.name();
      Check(who, config);
      const CourseFacts& courses = FindCourses(who, config.courses, config.courses.train);
      cell.num_training_courses = courses.num_courses;
      for (const Score* score : ScoresOf(group)) AddScores(cell, *score, config);
      config.courses.test = "";  // The scores are the plan's.
      // Courses count by what they are, not by where they lie.
      train::RunConfig anywhere = config;
      anywhere.courses = {.train = "", .test = "", .collection = "", .generator_seed = 0};
      cell.id = train::Digest(fmt::format(
          "{}\n{}\n{}\n{}\n{}\n{}\n{}", train::RunDigest(anywhere), courses.digest,
          config.run.max_steps, config.run.max_seconds, fmt::join(config.run.snapshot_steps, " "),
          fmt::join(config.run.snapshot_seconds, " "), platform_));
      cell.config = std::move(config);
      Add(std::move(cell));
    }
  }

  void AddPlanner(const Group& group, const Point& point) {
    Cell cell;
    cell.group = group.name;
    cell.row = point.labels;
    cell.planner = group.planner;
    const std::string who = cell.name();
    const std::vector<std::string> planners = planners::PlannerNames();
    if (std::ranges::find(planners, group.planner) == planners.end()) {
      Fail(who, fmt::format("there is no planner '{}', expected one of {}", group.planner,
                            fmt::join(planners, ", ")));
    }
    train::AgentRunConfig config;
    if (!group.preset.empty()) config = train::ReadAgentRunConfig(Beside(group.preset));
    const config::FieldList fields = config::ListFields(config);
    for (const auto* set : {&plan_.set, &plan_.overrides}) {
      for (const base::TomlAssignment& assignment : *set) {
        if (assignment.key == "courses.collection" || assignment.key == "courses.generator_seed") {
          Apply({assignment}, fields);
        }
      }
    }
    Apply(group.set, fields);
    Apply(point.set, fields);
    for (const Score* score : ScoresOf(group)) {
      if (score->planning || score->courses == "training") continue;  // Of policies only.
      AddScores(cell, *score, config);
    }
    train::AgentRunConfig anywhere = config;
    anywhere.courses = {};
    cell.id = train::Digest(
        fmt::format("planner {}\n{}\n{}", group.planner, config::ToToml(anywhere), platform_));
    Add(std::move(cell));
  }

  std::vector<const Score*> ScoresOf(const Group& group) const {
    const auto& names = group.scores.empty() ? plan_.sweep.scores : group.scores;
    std::vector<const Score*> scores;
    for (const Score& score : plan_.scores) {
      const bool wanted = names.empty() || std::ranges::find(names, score.name) != names.end();
      if (wanted) scores.push_back(&score);
    }
    return scores;
  }

  template <class CoursesConfig>
  const CourseFacts& FindCourses(const std::string& who, const CoursesConfig& config,
                                 const std::string& spec) {
    try {
      return courses_.Find(config, spec);
    } catch (const base::Error& error) {
      Fail(who, error.what());
    }
  }

  /// Adds the evaluations of a score: one, and one for each snapshot if the score asks for them.
  template <class Config>
  void AddScores(Cell& cell, const Score& score, Config task) {
    constexpr bool kIsPolicy = std::is_same_v<Config, train::RunConfig>;
    const std::string who = fmt::format("{}, score '{}'", cell.name(), score.name);
    const config::FieldList fields = config::ListFields(task);
    for (const std::string& profile : score.profiles) {
      train::LayProfile(Beside(profile), task.environment);
    }
    for (const auto& [key, value] : score.set) {
      if (!key.starts_with("environment.") && !key.starts_with("evaluation.") &&
          !key.starts_with("mpc.")) {
        Fail(value.where, fmt::format("score '{}' sets {}, expected a key of [environment], "
                                      "[evaluation] or [mpc]",
                                      score.name, key));
      }
      if (!kIsPolicy && key.starts_with("mpc.")) continue;
      config::SetField(key, value.text, value.where, fields);
    }
    if (!score.protocol.empty()) {
      config::SetField("evaluation.protocol", score.protocol,
                       fmt::format("{}: score '{}'", plan_.file.string(), score.name), fields);
    }
    if (score.episodes > 0) task.evaluation.episodes_per_course = score.episodes;
    ScoreTask base;
    base.name = score.name;
    base.courses = score.courses;
    std::string what_decides;
    std::vector<int> snapshots;
    if constexpr (kIsPolicy) {
      if (score.courses == "training") base.courses = task.courses.train;
      if (score.planning) task.mpc.enabled = true;
      if (task.mpc.enabled && task.method.model.kind == "none") {
        Fail(who,
             "planning needs a transition model, expected model.kind = \"deterministic\" or "
             "\"probabilistic\" in the training");
      }
      what_decides = config::ToToml(task.mpc);
      if (score.snapshots) snapshots = task.run.snapshot_steps;
      std::erase_if(snapshots, [&](int steps) { return steps > task.run.max_steps; });
    } else {
      Config anywhere = task;
      anywhere.courses = {};
      what_decides = config::ToToml(anywhere);
    }
    const CourseFacts& courses = FindCourses(who, task.courses, base.courses);
    base.num_courses = courses.num_courses;
    base.num_episodes = std::int64_t{courses.num_courses} * task.evaluation.episodes_per_course;
    base.task = config::ToToml(task);
    auto evaluation = task.evaluation;
    evaluation.num_environments = 1;  // Changes the speed alone.
    snapshots.insert(snapshots.begin(), 0);
    for (const int steps : snapshots) {
      ScoreTask one = base;
      one.snapshot_steps = steps;
      one.digest = train::Digest(fmt::format("{}\n{}\n{}\n{}\n{}", courses.digest,
                                             config::ToToml(task.environment),
                                             config::ToToml(evaluation), what_decides, steps));
      cell.scores.push_back(std::move(one));
    }
  }

  void Add(Cell cell) {
    const auto same = std::ranges::find(cells_, cell.id, &Cell::id);
    if (same != cells_.end()) {
      throw base::Error(fmt::format(
          "{}: '{}' and '{}' are the same training, expected different settings; give one of them "
          "the scores of both",
          plan_.file.string(), same->name(), cell.name()));
    }
    cells_.push_back(std::move(cell));
  }

  void CheckReferences() const {
    for (const Reference& reference : plan_.references) {
      for (const std::string& row : reference.rows) {
        const bool found =
            std::ranges::any_of(cells_, [&](const Cell& cell) { return cell.row_name() == row; });
        if (found) continue;
        std::vector<std::string> rows;
        for (const Cell& cell : cells_) {
          if (rows.empty() || rows.back() != cell.row_name()) rows.push_back(cell.row_name());
        }
        Fail(fmt::format("[[reference]] '{}'", reference.source),
             fmt::format("there is no row '{}', expected one of: {}", row, fmt::join(rows, "; ")));
      }
    }
  }

  const Plan& plan_;
  const std::string platform_;
  std::map<std::string, train::RunConfig> presets_;
  Courses courses_;
  std::vector<Cell> cells_;
  std::vector<std::string> axis_names_;
};

}  // namespace

std::string Cell::row_name() const {
  return row.empty() ? group : fmt::format("{}", fmt::join(row, " / "));
}

std::string Cell::name() const {
  return planner.empty() ? fmt::format("{}, seed {}", row_name(), seed) : row_name();
}

Cells ExpandPlan(const Plan& plan, const train::Platform& platform) {
  return Expansion(plan, platform).Run();
}

}  // namespace slalom::sweep
