#include "app/sweep/plan.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <set>
#include <string_view>
#include <utility>

#include "app/train/run_config.h"
#include "base/config.h"
#include "base/error.h"
#include "eval/comparison/comparison.h"

namespace slalom::sweep {
namespace {

namespace fs = std::filesystem;

bool IsName(std::string_view name) {
  return !name.empty() && !name.starts_with('-') && std::ranges::all_of(name, [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '-' || c == '_';
  });
}

/// Whether an override changes the plan itself, and not the config of its trainings.
bool IsOfPlan(std::string_view assignment) {
  return std::ranges::any_of(
      std::initializer_list<std::string_view>{"sweep.", "budget.", "slurm."},
      [assignment](std::string_view start) { return assignment.starts_with(start); });
}

/// `--set KEY=VALUE` of a key that is not the plan's. A planner's key is refused, as is no key.
base::TomlAssignment ParseOverride(const std::string& assignment) {
  train::RunConfig config;
  config::ApplyOverride(assignment, config::ListFields(config));  // Throws if there is no such key.
  const auto equals = assignment.find('=');
  return {assignment.substr(0, equals),
          {assignment.substr(equals + 1), fmt::format("--set {}", assignment)}};
}

class Checker {
 public:
  explicit Checker(const Plan& plan) : plan_(plan) {}

  void Check() const {
    if (!IsName(plan_.sweep.name)) {
      Fail("sweep.name is '{}', expected letters, digits, '-' and '_'", plan_.sweep.name);
    }
    CheckSeeds();
    CheckTrainer();
    CheckBudget();
    CheckScores();
    std::set<std::string> names;
    for (const Axis& axis : plan_.axes) CheckAxis(axis, "[[axis]]");
    CheckColumns();
    for (const Group& group : plan_.groups) {
      if (!IsName(group.name)) {
        Fail("[[group]] has the name '{}', expected letters, digits, '-' and '_'", group.name);
      }
      if (!names.insert(group.name).second) {
        Fail("two groups have the name '{}', expected different ones", group.name);
      }
      CheckGroup(group);
    }
    for (const Reference& reference : plan_.references) CheckReference(reference);
    for (const Conclusion& conclusion : plan_.conclusions) CheckConclusion(conclusion);
  }

 private:
  template <class... Args>
  [[noreturn]] void Fail(fmt::format_string<Args...> what, Args&&... args) const {
    throw base::Error("{}: {}", plan_.file.string(),
                      fmt::format(what, std::forward<Args>(args)...));
  }

  void CheckSeeds() const {
    if (plan_.sweep.seeds.empty()) Fail("sweep.seeds is empty, expected at least one seed");
    const std::set<int> different(plan_.sweep.seeds.begin(), plan_.sweep.seeds.end());
    if (different.size() != plan_.sweep.seeds.size()) {
      Fail("sweep.seeds names a seed twice, expected different ones");
    }
  }

  void CheckTrainer() const {
    if (plan_.sweep.trainer != Trainer::kService || !plan_.sweep.lockstep) return;
    Fail(
        "sweep.trainer = \"service\" and sweep.lockstep = true contradict each other, expected "
        "lockstep = false: processes that run side by side cannot be repeated bit for bit");
  }

  void CheckBudget() const {
    const BudgetSettings& budget = plan_.budget;
    const int given = (budget.steps > 0) + (budget.updates > 0) + (budget.seconds > 0.0);
    if (given > 1) Fail("[budget] has more than one limit, expected steps, updates or seconds");
    if (budget.seconds > 0.0 && plan_.sweep.lockstep) {
      Fail(
          "budget.seconds needs sweep.lockstep = false: what a training learns in a second depends "
          "on the machine, so it cannot be repeated bit for bit; or use budget.steps");
    }
  }

  void CheckScores() const {
    if (plan_.scores.empty()) {
      Fail("has no [[score]], expected at least one: the courses that the policies drive");
    }
    std::set<std::string> names;
    for (const Score& score : plan_.scores) {
      if (!IsName(score.name)) {
        Fail("[[score]] has the name '{}', expected letters, digits, '-' and '_'", score.name);
      }
      if (!names.insert(score.name).second) {
        Fail("two scores have the name '{}', expected different ones", score.name);
      }
      if (score.courses.empty()) {
        Fail("[[score]] '{}' has no courses, expected a course set", score.name);
      }
    }
    for (const std::string& quantity : plan_.sweep.quantities) {
      const auto known = QuantityKeys().choices;
      if (std::ranges::find(known, quantity) != known.end()) continue;
      Fail("sweep.quantities names '{}', expected one of {}", quantity, fmt::join(known, ", "));
    }
    for (const std::string& score : plan_.sweep.scores) {
      if (HasScore(score)) continue;
      Fail("sweep.scores names '{}', expected the name of a [[score]]", score);
    }
  }

  bool HasScore(const std::string& name) const {
    return std::ranges::find(plan_.scores, name, &Score::name) != plan_.scores.end();
  }

  void CheckAxis(const Axis& axis, const std::string& where) const {
    const std::string name = axis.name.empty() && !axis.keys.empty() ? axis.keys[0] : axis.name;
    if (axis.keys.empty()) Fail("{} '{}' has no keys, expected at least one", where, name);
    if (axis.values.empty()) Fail("{} '{}' is empty, expected at least one of values", where, name);
    if (!axis.labels.empty() && axis.labels.size() != axis.values.size()) {
      Fail("{} '{}' has {} labels and {} values, expected as many", where, name, axis.labels.size(),
           axis.values.size());
    }
    if (!axis.num_seeds.empty() && axis.num_seeds.size() != axis.values.size()) {
      Fail("{} '{}' has {} num_seeds and {} values, expected as many", where, name,
           axis.num_seeds.size(), axis.values.size());
    }
  }

  /// The axis with `columns = true`, and whether every score is of one of its values.
  void CheckColumns() const {
    const Axis* columns = ColumnAxis(plan_);
    if (std::ranges::count(plan_.axes, true, &Axis::columns) > 1) {
      Fail("two axes have columns = true, expected at most one");
    }
    const std::vector<std::string> labels =
        columns ? AxisLabels(*columns) : std::vector<std::string>();
    for (const Score& score : plan_.scores) {
      if (!columns && !score.column.empty()) {
        Fail("[[score]] '{}' has the column '{}', but no [[axis]] has columns = true", score.name,
             score.column);
      }
      if (columns && std::ranges::find(labels, score.column) == labels.end()) {
        Fail("[[score]] '{}' has the column '{}', expected a label of the axis '{}': {}",
             score.name, score.column, AxisName(*columns), fmt::join(labels, ", "));
      }
    }
  }

  void CheckGroup(const Group& group) const {
    for (const Axis& axis : group.axes) {
      CheckAxis(axis, fmt::format("[[group.axis]] of '{}'", group.name));
      if (axis.columns) {
        Fail(
            "[[group.axis]] '{}' of '{}' has columns = true, expected that of an [[axis]] of the "
            "plan only",
            AxisName(axis), group.name);
      }
    }
    for (const std::string& score : group.scores) {
      if (HasScore(score)) continue;
      Fail("group '{}' names the score '{}', expected the name of a [[score]]", group.name, score);
    }
    if (group.planner.empty() && group.preset.empty() && plan_.sweep.preset.empty()) {
      Fail("group '{}' has no preset, expected one here or in [sweep]", group.name);
    }
  }

  void RequireScore(const std::string& where, const std::string& score) const {
    if (HasScore(score)) return;
    Fail("{} names the score '{}', expected the name of a [[score]]", where, score);
  }

  void CheckReference(const Reference& reference) const {
    RequireScore(fmt::format("[[reference]] '{}'", reference.source), reference.score);
    if (reference.rows.size() != reference.values.size() ||
        (!reference.deviations.empty() && reference.deviations.size() != reference.values.size())) {
      Fail("[[reference]] '{}' has {} rows, {} values and {} deviations, expected as many of each",
           reference.source, reference.rows.size(), reference.values.size(),
           reference.deviations.size());
    }
  }

  void CheckConclusion(const Conclusion& conclusion) const {
    const std::string where = fmt::format("[[conclusion]] '{}'", conclusion.text);
    if (conclusion.text.empty()) Fail("[[conclusion]] has no text, expected a sentence");
    RequireScore(where, conclusion.score);
    RequireScore(where, conclusion.other_score());
    if (conclusion.rows.empty()) Fail("{} has no rows, expected at least one", where);
    const std::size_t others = conclusion.than.size();
    if (others > 1 && others != conclusion.rows.size()) {
      Fail("{} has {} rows and {} in conclusion.than, expected none, one or as many", where,
           conclusion.rows.size(), others);
    }
    if (others == 0 && !conclusion.than_score.empty()) {
      Fail("{} has conclusion.than_score without conclusion.than, expected both", where);
    }
    if (conclusion.kind == ConclusionKind::kWithin && conclusion.limit <= 0.0) {
      Fail("{} has conclusion.limit = {}, expected more than 0 with conclusion.kind = \"within\"",
           where, conclusion.limit);
    }
  }

  const Plan& plan_;
};

}  // namespace

base::OneOf QuantityKeys() {
  base::OneOf keys{};
  for (const eval::Quantity& quantity : eval::Quantities()) {
    if (quantity.aggregate == eval::Aggregate::kMean) keys.choices.push_back(quantity.key);
  }
  return keys;
}

std::vector<fs::path> PlanFiles(const fs::path& given) {
  const fs::path file = config::Locate(given);
  Plan list;
  try {
    config::ReadTomlFile(file, config::ListFields(list));
  } catch (const base::Error& error) {
    if (config::HasSection(file, "sweep") || !fs::exists(file)) throw;
    throw base::Error(
        "{}: has no section [sweep], expected the plan of a sweep (a config is trained with: "
        "slalom train {}): {}",
        given.string(), given.string(), error.what());
  }
  if (list.sweep.plans.empty()) return {file};
  Plan only_plans;
  only_plans.sweep.plans = list.sweep.plans;
  base::ThrowIf(config::ToToml(list) != config::ToToml(only_plans),
                "{}: has sweep.plans and other keys, expected nothing but the list of plans",
                file.string());
  std::vector<fs::path> files;
  for (const std::string& path : list.sweep.plans) {
    files.push_back(file.parent_path() / path);
    Plan plan;
    config::ReadTomlFile(files.back(), config::ListFields(plan));
    if (plan.sweep.plans.empty()) continue;
    throw base::Error("{}: sweep.plans names {}, which is a list of plans; expected a plan",
                      file.string(), path);
  }
  return files;
}

namespace {

/// Reads the keys of a plan over those of `plan`.
Plan ReadKeys(Plan plan, const fs::path& file, std::span<const std::string> overrides) {
  const config::FieldList fields = config::ListFields(plan);
  config::ReadTomlFile(file, fields);
  base::ThrowIf(!plan.sweep.plans.empty(), "{}: is a list of plans, expected one of them: {}",
                file.string(), fmt::join(plan.sweep.plans, ", "));
  plan.file = config::Locate(file);
  for (const std::string& assignment : overrides) {
    if (IsOfPlan(assignment)) {
      config::ApplyOverride(assignment, fields);
    } else {
      plan.overrides.push_back(ParseOverride(assignment));
    }
  }
  return plan;
}

}  // namespace

Plan ReadPlan(const fs::path& file, std::span<const std::string> overrides) {
  Plan plan = ReadKeys({}, file, overrides);
  if (plan.sweep.trainer == Trainer::kService) {
    Plan of_service;
    of_service.sweep.lockstep = false;
    plan = ReadKeys(std::move(of_service), file, overrides);
  }
  if (plan.sweep.name.empty()) plan.sweep.name = file.stem().string();
  if (plan.sweep.title.empty()) plan.sweep.title = plan.sweep.name;
  if (plan.groups.empty()) {
    Group group;
    group.name = plan.sweep.name;
    plan.groups.push_back(std::move(group));
  }
  for (Group& group : plan.groups) {
    if (group.label.empty()) group.label = group.name;
  }
  for (Score& score : plan.scores) {
    if (score.label.empty()) score.label = score.name;
  }
  Checker(plan).Check();
  return plan;
}

namespace {

/// A value as a label: a string without its quotes.
std::string Label(const base::TomlValue& value) {
  const std::string& text = value.text;
  const bool quoted = text.size() >= 2 && (text.front() == '"' || text.front() == '\'') &&
                      text.back() == text.front();
  return quoted ? text.substr(1, text.size() - 2) : text;
}

base::TomlAssignments AssignmentsOf(const Axis& axis, const base::TomlValue& value) {
  if (axis.keys.size() == 1) return {{axis.keys[0], value}};
  const std::vector<base::TomlValue> elements = config::ElementsOf(value);
  base::ThrowIf(elements.size() != axis.keys.size(),
                "{}: {} has {} values, expected {}: one for each of the axis' keys {}", value.where,
                value.text, elements.size(), axis.keys.size(), fmt::join(axis.keys, ", "));
  base::TomlAssignments set;
  for (std::size_t i = 0; i < axis.keys.size(); ++i) {
    set.push_back({axis.keys[i], {elements[i].text, value.where}});
  }
  return set;
}

}  // namespace

std::vector<Point> Product(const std::vector<const Axis*>& axes) {
  std::vector<Point> points = {{}};
  for (const Axis* axis : axes) {
    std::vector<Point> more;
    const std::vector<std::string> labels = AxisLabels(*axis);
    for (const Point& point : points) {
      for (std::size_t i = 0; i < axis->values.size(); ++i) {
        Point next = point;
        const auto set = AssignmentsOf(*axis, axis->values[i]);
        next.set.insert(next.set.end(), set.begin(), set.end());
        next.labels.push_back(labels[i]);
        if (!axis->num_seeds.empty()) next.max_seeds = std::min(next.max_seeds, axis->num_seeds[i]);
        more.push_back(std::move(next));
      }
    }
    points = std::move(more);
  }
  return points;
}

std::string AxisName(const Axis& axis) { return axis.name.empty() ? axis.keys[0] : axis.name; }

std::vector<std::string> AxisLabels(const Axis& axis) {
  if (!axis.labels.empty()) return axis.labels;
  std::vector<std::string> labels;
  for (const base::TomlValue& value : axis.values) labels.push_back(Label(value));
  return labels;
}

const Axis* ColumnAxis(const Plan& plan) {
  const auto found = std::ranges::find(plan.axes, true, &Axis::columns);
  return found == plan.axes.end() ? nullptr : &*found;
}

}  // namespace slalom::sweep
