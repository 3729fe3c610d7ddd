#include "app/sweep/cell.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "app/sweep/plan.h"
#include "app/train/agent_run_config.h"
#include "app/train/inputs.h"
#include "app/train/planner_fit.h"
#include "app/train/profile.h"
#include "app/train/run_identity.h"
#include "app/train/sweep_files.h"
#include "base/config.h"
#include "base/error.h"
#include "base/file.h"
#include "policy/policy.h"
#include "sim/courses/course_file.h"
#include "sim/courses/course_sets.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;

void Apply(const base::TomlAssignments& set, const config::FieldList& fields) {
  for (const auto& [key, value] : set) config::SetField(key, value.text, value.where, fields);
}

/// Whether a key says where the processes of a service are and where they keep their files. A cell
/// that has a service of its own decides it.
bool OwnsService(std::string_view key) {
  return (key.starts_with("service.") && key != "service.io_threads") ||
         key.starts_with("security.") || key == "replay_server.directory" ||
         key == "learner_service.directory" || key == "learner_service.exit_when_finished";
}

bool Sets(const base::TomlAssignments& set, std::string_view key) {
  return std::ranges::find(set, key, &base::TomlAssignment::key) != set.end();
}

/// The environment steps after which a training of this config has made `updates` updates.
std::int64_t StepsForUpdates(const train::RunConfig& config, std::int64_t updates) {
  return config.run.learning_starts +
         static_cast<std::int64_t>(
             std::ceil(static_cast<double>(updates) / config.run.updates_per_step));
}

/// Throws `base::Error` if `slalom evaluate` would refuse the policy of the finished training:
/// because the task has other observations or actions than the training, or because the policy
/// cannot plan yet. `snapshots`: steps at which policies are scored, too.
void RequireScorable(const train::RunConfig& trained, const train::RunConfig& task,
                     const std::vector<int>& snapshots) {
  policy::RequireSameInterface("the policy", train::MakePolicySpec(trained),
                               sim::MakeObservationSpec(task.environment), task.environment.action);
  base::ThrowIf(
      task.environment.lidar.field_of_view != trained.environment.lidar.field_of_view,
      "environment.lidar.field_of_view is {} rad, expected {}, which the policy is trained with",
      task.environment.lidar.field_of_view, trained.environment.lidar.field_of_view);
  if (!task.mpc.enabled) return;
  const std::int64_t first = StepsForUpdates(task, task.mpc.learning_starts);
  for (const std::int64_t steps : snapshots) {
    if (steps >= first) continue;
    throw base::Error(
        "there is no planning at {} steps, expected snapshots from {} steps on "
        "(mpc.learning_starts = {})",
        steps, first, task.mpc.learning_starts);
  }
}

/// The facts about a course set that a cell's identity needs.
struct CourseFacts {
  int num_courses = 0;
  std::string digest;  ///< Digest of the courses themselves, not of their place or the set's name.
};

/// Reads each course set once. Thread-compatible.
class CourseFactsCache {
 public:
  /// The set that `spec` names. Throws `base::Error` like `sim::ResolveCourses`.
  const CourseFacts& Find(const std::string& collection, std::int64_t generator_seed,
                          const std::string& spec) {
    const std::string key = fmt::format("{}\n{}\n{}", collection, generator_seed, spec);
    auto found = facts_.find(key);
    if (found == facts_.end()) {
      sim::CourseSet set =
          sim::ResolveCourses(spec, collection, static_cast<std::uint64_t>(generator_seed));
      set.name = "courses";  // The digest must not depend on the set's name.
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

/// Turns a plan into cells.
class Expansion {
 public:
  Expansion(const Plan& plan, const train::Platform& platform)
      : plan_(plan),
        platform_(plan.sweep.mixed_platforms
                      ? fmt::format("numerics {}, any machine", platform.numerics)
                      : train::Describe(platform)),
        trains_(std::ranges::any_of(plan.groups, &std::string::empty, &Group::planner)) {}

  Cells Run() {
    // Heads of tables: the group, if rows differ by it, then the axes.
    const bool names_groups = plan_.groups.size() > 1;
    for (const Group& group : plan_.groups) {
      std::vector<const Axis*> axes;
      if (group.planner.empty()) {
        for (const Axis& axis : plan_.axes) {
          if (!axis.columns) axes.push_back(&axis);
        }
      }
      for (const Axis& axis : group.axes) axes.push_back(&axis);
      if (axes.size() > axis_names_.size()) {
        axis_names_.clear();
        for (const Axis* axis : axes) axis_names_.push_back(AxisName(*axis));
      }
      // The axis of the columns is the last, so that its label is easy to take off.
      const Axis* columns = group.planner.empty() ? ColumnAxis(plan_) : nullptr;
      if (columns) axes.push_back(columns);
      for (Point& point : Product(axes)) {
        std::string column;
        if (columns) {
          column = std::move(point.labels.back());
          point.labels.pop_back();
        }
        if (names_groups) point.labels.insert(point.labels.begin(), group.label);
        if (group.planner.empty()) {
          AddTrainings(group, point, column);
        } else {
          AddPlanner(group, point);
        }
      }
    }
    if (names_groups) axis_names_.insert(axis_names_.begin(), "method");
    CheckTables();
    return {std::move(cells_), std::move(axis_names_)};
  }

 private:
  [[noreturn]] void Fail(const std::string& who, const std::string& what) const {
    throw base::Error("{}: {}: {}", plan_.file.string(), who, what);
  }

  fs::path RelativeToPlan(const std::string& path) const { return plan_.file.parent_path() / path; }

  template <class Config>
  void LayProfiles(const std::vector<std::string>& profiles, Config& config) const {
    for (const std::string& profile : profiles) {
      train::LayProfile(RelativeToPlan(profile), config.environment, config.guard);
    }
  }

  const train::RunConfig& Preset(const std::string& preset) {
    auto found = presets_.find(preset);
    if (found == presets_.end()) {
      train::RunConfig config;
      config::ReadTomlFile(RelativeToPlan(preset), config::ListFields(config));
      found = presets_.emplace(preset, std::move(config)).first;
    }
    return found->second;
  }

  train::RunConfig Configure(const Group& group, const Point& point) {
    train::RunConfig config = Preset(group.preset.empty() ? plan_.sweep.preset : group.preset);
    LayProfiles(group.profiles, config);
    const config::FieldList fields = config::ListFields(config);
    bool limits_steps = false;
    for (const auto* set : {&plan_.set, &group.set, &point.set, &plan_.overrides}) {
      RefuseKeysOfTheSweep(*set);
      Apply(*set, fields);
      limits_steps = limits_steps || Sets(*set, "run.max_steps");
    }
    // The command line overrides the budget, which needs all other keys.
    const std::int64_t max_steps = config.run.max_steps;
    limits_steps = ApplyBudget(config) || limits_steps;
    if (Sets(plan_.overrides, "run.max_steps")) config.run.max_steps = max_steps;
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
    if (IsOfService()) config.run.deterministic = false;
    // Keys that the sweep itself decides.
    config.run.name = train::kCellRunDirectory;
    // The runner removes it in the end.
    config.run.keep_checkpoints = run::KeepCheckpoints::kNewest;
    return config;
  }

  bool IsOfService() const { return plan_.sweep.trainer == Trainer::kService; }

  /// Keys that the sweep itself decides would be set in vain.
  void RefuseKeysOfTheSweep(const base::TomlAssignments& set) const {
    for (const auto& [key, value] : set) {
      for (const auto& [theirs, ours] :
           {std::pair{"run.seed", "sweep.seeds"},
            {"run.deterministic", "sweep.lockstep"},
            {"run.name", "labels, as a cell is named by its id"},
            {"run.keep_checkpoints", "nothing, as checkpoints of finished cells are removed"}}) {
        if (key == theirs) {
          Fail(value.where, fmt::format("{} is the sweep's to decide; use {}", key, ours));
        }
      }
      if (IsOfService() && OwnsService(key)) {
        Fail(value.where, fmt::format("{} is the sweep's to decide, as each cell has a service of "
                                      "its own (sweep.trainer)",
                                      key));
      }
      if (key == "run.max_seconds" && plan_.sweep.lockstep && value.text != "0" &&
          value.text != "0.0") {
        Fail(value.where,
             "a training in lockstep ends by steps; use budget.steps, or budget.seconds "
             "with sweep.lockstep = false");
      }
    }
  }

  /// Returns whether it limits the steps.
  bool ApplyBudget(train::RunConfig& config) const {
    const BudgetSettings& budget = plan_.budget;
    if (budget.seconds > 0.0) config.run.max_seconds = budget.seconds;
    if (budget.steps > 0) config.run.max_steps = budget.steps;
    if (budget.updates > 0) config.run.max_steps = StepsForUpdates(config, budget.updates);
    return budget.steps > 0 || budget.updates > 0;
  }

  train::ResolvedRun Resolve(const std::string& who, const train::RunConfig& config) const {
    try {
      train::ResolvedRun run = train::Resolve(
          config, {.drives = "slalom sweep", .begins = true, .serves = IsOfService()});
      (void)train::LoadFirstPolicy(run);
      return run;
    } catch (const base::Error& error) {
      Fail(who, error.what());
    }
  }

  void AddTrainings(const Group& group, const Point& point, const std::string& column) {
    const train::RunConfig resolved = Configure(group, point);
    const std::size_t num_seeds = std::min<std::size_t>(plan_.sweep.seeds.size(), point.max_seeds);
    for (const int seed : std::span(plan_.sweep.seeds).first(num_seeds)) {
      Cell cell;
      cell.group = group.name;
      cell.row = point.labels;
      cell.column = column;
      cell.seed = seed;
      train::RunConfig config = resolved;
      config.run.seed = seed;
      const std::string who = cell.name();
      cell.config = Resolve(who, config);
      const CourseFacts courses = config.courses.has_named()
                                      ? FindCourses(who, config.courses, config.courses.train)
                                      : CourseFacts{};
      cell.num_training_courses = courses.num_courses;
      for (const Score* score : ScoresOf(group)) {
        if (score->column == column) AddScores(cell, *score, config);
      }
      if (cell.scores.empty()) continue;  // Its group has no score of this column.
      cell.config->courses.test = "";     // The scores are the plan's.
      // The id depends on the courses and policies themselves, not on where these lie.
      train::RunConfig anywhere = *cell.config;
      anywhere.method.learner.from = "";
      static_cast<train::CollectionConfig&>(anywhere.courses) = {};
      anywhere.courses.train = train::CoursesConfig{}.train;
      cell.id = train::Digest(fmt::format(
          "{}\n{}\n{}\n{}\n{}\n{}\n{}{}", train::RunDigest(anywhere), courses.digest,
          config.run.max_steps, config.run.max_seconds, fmt::join(config.run.snapshot_steps, " "),
          fmt::join(config.run.snapshot_seconds, " "),
          IsOfService() ? fmt::format("{}\na service of {} actors", platform_, plan_.sweep.actors)
                        : platform_,
          DescribePolicies(who, *cell.config)));
      if (IsOfService()) cell.num_actors = plan_.sweep.actors;
      Describe(config, cell);
      Add(std::move(cell));
    }
  }

  /// `defaults`, with the plan's keys of a planner laid over them.
  train::AgentRunConfig ConfigurePlanner(const Group& group, const Point& point,
                                         train::AgentRunConfig defaults) {
    train::AgentRunConfig config = std::move(defaults);
    if (!group.preset.empty()) {
      config = train::ReadAgentRunConfig(RelativeToPlan(group.preset), std::move(config));
    }
    LayProfiles(group.profiles, config);
    const config::FieldList fields = config::ListFields(config);
    for (const auto* set : {&plan_.set, &plan_.overrides}) {
      for (const base::TomlAssignment& assignment : *set) {
        if (assignment.key == "courses.collection" || assignment.key == "courses.generator_seed") {
          Apply({assignment}, fields);
        } else if (!trains_) {
          Fail(assignment.value.where,
               fmt::format("{} is a key of trainings, and the plan has none; expected it in the "
                           "`set` of a group",
                           assignment.key));
        }
      }
    }
    for (const auto* set : {&group.set, &point.set}) {
      for (const auto& [key, value] : *set) train::RequireReadBy(group.planner, key, value.where);
      Apply(*set, fields);
    }
    return config;
  }

  void AddPlanner(const Group& group, const Point& point) {
    Cell cell;
    cell.group = group.name;
    cell.row = point.labels;
    cell.planner = group.planner;
    const std::string who = cell.name();
    const std::vector<std::string> planners = train::PlannerAndOracleNames();
    if (std::ranges::find(planners, group.planner) == planners.end()) {
      Fail(who, fmt::format("there is no planner '{}', expected one of {}", group.planner,
                            fmt::join(planners, ", ")));
    }
    for (const Score* score : ScoresOf(group)) {
      if (score->planning || score->courses == "training") continue;  // For policies only.
      const auto published = train::DefaultsOfPublishedRuns(score->protocol);
      AddScores(cell, *score,
                ConfigurePlanner(group, point, published.value_or(train::AgentRunConfig{})));
    }
    train::AgentRunConfig anywhere = ConfigurePlanner(group, point, {});
    Describe(anywhere, cell);
    anywhere.courses = {};
    cell.id = train::Digest(
        fmt::format("planner {}\n{}\n{}", group.planner, config::Changes(anywhere), platform_));
    Add(std::move(cell));
  }

  /// Sets the facts of a cell's task that titles of reports show.
  template <class Config>
  static void Describe(const Config& config, Cell& cell) {
    cell.collection = fs::path(config.courses.collection).filename().string();
    const bool is_drawn = Sets(config.environment.randomize, "robot.friction");
    cell.friction = is_drawn ? "drawn" : base::EnumName(config.environment.robot.friction);
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

  const CourseFacts& FindCourses(const std::string& who, const train::CollectionConfig& config,
                                 const std::string& spec) {
    try {
      return courses_.Find(config.collection, config.generator_seed, spec);
    } catch (const base::Error& error) {
      Fail(who, error.what());
    }
  }

  /// The contents of the policies that a training starts or learns from, a line for each.
  std::string DescribePolicies(const std::string& who, const train::ResolvedRun& run) const {
    std::string lines;
    try {
      for (const std::string& file : train::PolicyFilesOf(run)) {
        lines += "\npolicy " + train::Digest(base::ReadFile(file));
      }
    } catch (const base::Error& error) {
      Fail(who, error.what());
    }
    return lines;
  }

  /// Adds the evaluations of a score: one, and one for each snapshot if the score asks for them.
  template <class Config>
  void AddScores(Cell& cell, const Score& score, const Config& config) {
    Config task = config;
    constexpr bool kIsPolicy = std::is_same_v<Config, train::RunConfig>;
    const std::string who = fmt::format("{}, score '{}'", cell.name(), score.name);
    const config::FieldList fields = config::ListFields(task);
    LayProfiles(score.profiles, task);
    for (const auto& [key, value] : score.set) {
      if (!key.starts_with("environment.") && !key.starts_with("evaluation.") &&
          !key.starts_with("guard.") && !key.starts_with("mpc.")) {
        Fail(value.where, fmt::format("score '{}' sets {}, expected a key of [environment], "
                                      "[evaluation], [guard] or [mpc]",
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
    base.physics = score.physics;
    std::string what_decides;
    std::vector<int> snapshots;
    if constexpr (kIsPolicy) {
      if (score.courses == "training") {
        if (!task.courses.has_named()) {
          Fail(who, fmt::format("score '{}' is on training courses, expected courses.train to name "
                                "some",
                                score.name));
        }
        base.courses = task.courses.train;
      }
      if (score.planning) task.mpc.enabled = true;
      if (task.mpc.enabled && task.method.model.kind == nn::ModelKind::kNone) {
        Fail(who,
             "planning needs a transition model, expected model.kind = \"deterministic\" or "
             "\"probabilistic\" in the training");
      }
      what_decides = config::Changes(task.mpc);
      if (score.snapshots) snapshots = task.run.snapshot_steps;
      std::erase_if(snapshots, [&](int steps) { return steps <= 0 || steps > task.run.max_steps; });
      std::ranges::sort(snapshots);
      snapshots.erase(std::unique(snapshots.begin(), snapshots.end()), snapshots.end());
      (void)Resolve(who, task);
      try {
        RequireScorable(config, task, snapshots);
      } catch (const base::Error& error) {
        Fail(who, error.what());
      }
    } else {
      train::FitToRobot(task.environment, task.planners);
      what_decides = config::Changes(task.planners);
    }
    what_decides += config::Changes(task.guard);
    const CourseFacts& courses = FindCourses(who, task.courses, base.courses);
    base.num_courses = courses.num_courses;
    base.num_episodes = std::int64_t{courses.num_courses} * task.evaluation.episodes_per_course;
    base.task = config::ToToml(task);
    auto evaluation = task.evaluation;
    // Changes the speed alone.
    evaluation.num_environments = eval::EvaluationConfig{}.num_environments;
    // The default leaves no mark.
    const std::string other_physics = score.physics == "slalom" ? "" : "\n" + score.physics;
    snapshots.insert(snapshots.begin(), 0);
    for (const int steps : snapshots) {
      ScoreTask one = base;
      one.snapshot_steps = steps;
      one.digest = train::Digest(fmt::format("{}\n{}\n{}\n{}\n{}", courses.digest,
                                             config::Changes(task.environment),
                                             config::Changes(evaluation), what_decides, steps) +
                                 other_physics);
      cell.scores.push_back(std::move(one));
    }
  }

  void Add(Cell cell) {
    const auto same = std::ranges::find(cells_, cell.id, &Cell::id);
    if (same != cells_.end()) {
      throw base::Error(
          "{}: '{}' and '{}' are the same training, expected different settings; give one of them "
          "the scores of both",
          plan_.file.string(), same->name(), cell.name());
    }
    base::ThrowIf(
        !names_.insert(cell.name()).second,
        "{}: two trainings are called '{}', expected different labels of groups or of an axis",
        plan_.file.string(), cell.name());
    cells_.push_back(std::move(cell));
  }

  /// Fails unless each row is one of the plan's.
  void CheckRows(const std::string& where, const std::vector<std::string>& names) const {
    for (const std::string& name : names) {
      if (std::ranges::find(cells_, name, &Cell::row_name) != cells_.end()) continue;
      std::vector<std::string> rows;
      for (const Cell& cell : cells_) {
        if (rows.empty() || rows.back() != cell.row_name()) rows.push_back(cell.row_name());
      }
      Fail(where,
           fmt::format("there is no row '{}', expected one of: {}", name, fmt::join(rows, "; ")));
    }
  }

  /// Fails unless each row has the score.
  void CheckScored(const std::string& where, const std::vector<std::string>& names,
                   const std::string& score) const {
    CheckRows(where, names);
    for (const std::string& name : names) {
      const bool is_scored = std::ranges::any_of(cells_, [&](const Cell& cell) {
        return cell.row_name() == name &&
               std::ranges::find(cell.scores, score, &ScoreTask::name) != cell.scores.end();
      });
      if (is_scored) continue;
      Fail(where,
           fmt::format("the row '{}' has no score '{}', expected one that it has", name, score));
    }
  }

  void CheckTables() const {
    for (const Reference& reference : plan_.references) {
      CheckRows(fmt::format("[[reference]] '{}'", reference.source), reference.rows);
    }
    for (const Conclusion& conclusion : plan_.conclusions) {
      const std::string where = fmt::format("[[conclusion]] '{}'", conclusion.text);
      CheckScored(where, conclusion.rows, conclusion.score);
      CheckScored(where, conclusion.than, conclusion.other_score());
    }
  }

  const Plan& plan_;
  const std::string platform_;
  const bool trains_;  // Whether any group of the plan is trained.
  std::map<std::string, train::RunConfig> presets_;
  CourseFactsCache courses_;
  std::vector<Cell> cells_;
  std::set<std::string> names_;
  std::vector<std::string> axis_names_;
};

}  // namespace

std::string Cell::row_name() const {
  return row.empty() ? group : fmt::format("{}", fmt::join(row, " / "));
}

std::string Cell::training_name() const {
  return column.empty() ? row_name() : fmt::format("{}, {}", row_name(), column);
}

std::string Cell::name() const {
  return planner.empty() ? fmt::format("{}, seed {}", training_name(), seed) : row_name();
}

Cells ExpandPlan(const Plan& plan, const train::Platform& platform) {
  return Expansion(plan, platform).Run();
}

}  // namespace slalom::sweep
