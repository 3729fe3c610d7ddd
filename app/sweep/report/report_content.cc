#include "app/sweep/report/report_content.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <map>
#include <set>
#include <span>

#include "app/train/resolved_run.h"
#include "base/progress.h"
#include "eval/report/table_text.h"
#include "eval/statistics/bootstrap.h"
#include "eval/statistics/score_table.h"

namespace slalom::sweep {
namespace {

/// The cells of a row that are trained and have every one of its snapshots.
std::vector<std::size_t> WholeCells(const SweepResults& results,
                                    std::span<const RowScore> snapshots) {
  std::vector<std::size_t> cells;
  for (const CellScore& seed : snapshots.front().seeds) {
    const bool is_whole = std::ranges::all_of(snapshots, [&](const RowScore& row) {
      const auto found = std::ranges::find(row.seeds, seed.cell, &CellScore::cell);
      return found != row.seeds.end() && found->result.courses.size() == seed.result.courses.size();
    });
    if (is_whole && results.statuses[seed.cell].trained) cells.push_back(seed.cell);
  }
  return cells;
}

/// Success of these cells by seed and course.
eval::ScoreTable SuccessOf(const SweepResults& results, const RowScore& row,
                           const std::vector<std::size_t>& cells) {
  eval::Agent agent = AgentOf(results, row);
  agent.seeds.clear();
  for (const CellScore& seed : row.seeds) {
    if (std::ranges::find(cells, seed.cell) != cells.end()) agent.seeds.push_back(&seed.result);
  }
  return eval::ScoresOf(agent, eval::Quantities().front());
}

/// Training time at each point, [s]; empty if one of them is not known or they do not rise.
std::vector<double> SecondsOf(const SweepResults& results, std::size_t cell,
                              std::span<const std::int64_t> steps) {
  std::vector<double> seconds;
  for (const std::int64_t at : steps) {
    const TrainedCell& trained = *results.statuses[cell].trained;
    const auto found = results.snapshot_seconds.find({cell, at});
    const bool is_last = at == steps.back() && at >= trained.steps;
    if (!is_last && found == results.snapshot_seconds.end()) return {};
    const double here = is_last ? trained.training_s : found->second;
    if (!seconds.empty() && here <= seconds.back()) return {};
    seconds.push_back(here);
  }
  return seconds;
}

/// The area under each seed's curve on each course. `tables`: [point], `x`: [seed][point]
eval::Estimate AreaOf(const std::vector<eval::ScoreTable>& tables,
                      const std::vector<std::vector<double>>& x) {
  eval::ScoreTable areas = tables.front();
  for (std::size_t s = 0; s < areas.scores.size(); ++s) {
    for (std::size_t c = 0; c < areas.scores[s].size(); ++c) {
      std::vector<double> heights;
      heights.reserve(tables.size());
      for (const eval::ScoreTable& table : tables) heights.push_back(table.scores[s][c]);
      areas.scores[s][c] = eval::AreaUnderCurve(x[s], heights);
    }
  }
  return eval::BootstrapMean(areas);
}

/// The curve of one row from its snapshots, by steps. Without points if there are fewer than two.
LearningCurve CurveOf(const SweepResults& results, std::span<const RowScore> snapshots) {
  const std::vector<std::size_t> cells = WholeCells(results, snapshots);
  LearningCurve curve{.num_seeds = static_cast<int>(cells.size()),
                      .num_planned = snapshots.front().num_planned};
  if (cells.empty()) return curve;
  std::vector<std::int64_t> steps;
  std::vector<eval::ScoreTable> tables;
  for (const RowScore& row : snapshots) {
    const std::int64_t at = row.snapshot_steps > 0 ? row.snapshot_steps
                                                   : results.statuses[cells.front()].trained->steps;
    // A snapshot at the last step is the finished policy.
    if (!steps.empty() && at <= steps.back()) continue;
    steps.push_back(at);
    tables.push_back(SuccessOf(results, row, cells));
  }
  if (steps.size() < 2) return curve;
  std::vector<std::vector<double>> seconds;
  seconds.reserve(cells.size());
  for (const std::size_t cell : cells) seconds.push_back(SecondsOf(results, cell, steps));
  const bool has_seconds = std::ranges::find(seconds, std::vector<double>()) == seconds.end();
  for (std::size_t p = 0; p < steps.size(); ++p) {
    LearningCurve::Point& point = curve.points.emplace_back();
    point.steps = static_cast<double>(steps[p]);
    point.success = eval::BootstrapMean(tables[p]);
    if (!has_seconds) continue;
    double sum = 0.0;
    for (const auto& of_seed : seconds) sum += of_seed[p];
    point.seconds = sum / curve.num_seeds;
  }
  curve.area_over_steps =
      AreaOf(tables, std::vector(cells.size(), std::vector<double>(steps.begin(), steps.end())));
  if (has_seconds) curve.area_over_seconds = AreaOf(tables, seconds);
  return curve;
}

}  // namespace

std::vector<LearningCurve> LearningCurves(const SweepResults& results, const ScoreResults& score) {
  std::vector<LearningCurve> curves;
  const std::span<const RowScore> all(score.snapshots);
  for (std::size_t begin = 0, end = 0; begin < all.size(); begin = end) {
    while (end < all.size() && all[end].row == all[begin].row) ++end;
    LearningCurve curve = CurveOf(results, all.subspan(begin, end - begin));
    if (curve.points.empty()) continue;
    const auto agent = std::ranges::find(score.rows, all[begin].row, &RowScore::row);
    curve.agent = static_cast<std::size_t>(agent - score.rows.begin());
    curves.push_back(std::move(curve));
  }
  return curves;
}

namespace {

namespace fs = std::filesystem;

/// "200k steps", "100k to 2M steps": the least and the largest budget of the trainings.
std::string Span(const std::set<double>& values, const std::function<std::string(double)>& print) {
  const std::string least = print(*values.begin());
  const std::string most = print(*values.rbegin());
  return least == most ? least : fmt::format("{} to {}", least, most);
}

/// How long the trainings were to last.
std::string BudgetText(const Cells& cells) {
  std::set<double> steps;
  std::set<double> seconds;
  for (const Cell& cell : cells.cells) {
    if (!cell.config) continue;
    const run::RunSettings& run = cell.config->run;
    if (run.max_seconds > 0.0) {
      seconds.insert(run.max_seconds);
    } else {
      steps.insert(static_cast<double>(train::MaxStepsOf(*cell.config)));
    }
  }
  std::vector<std::string> texts;
  if (!steps.empty()) texts.push_back(Span(steps, base::FormatCount) + " steps");
  if (!seconds.empty()) texts.push_back(Span(seconds, base::FormatDuration) + " of training time");
  return fmt::format("{}", fmt::join(texts, ", "));
}

/// "4 of 9 done, 4 waiting, 1 failed"
std::string ProgressText(const SweepResults& results) {
  std::string text =
      fmt::format("{} of {} done", results.num_cells(CellState::kDone), results.statuses.size());
  for (const CellState state :
       {CellState::kTraining, CellState::kScoring, CellState::kWaiting, CellState::kFailed}) {
    if (const int count = results.num_cells(state); count > 0) {
      text += fmt::format(", {} {}", count, ToString(state));
    }
  }
  return text;
}

/// The programs and machines that the numbers are from.
struct Origins {
  std::set<std::string> commits;
  std::set<std::string> platforms;
  std::map<std::string, int> machines;  ///< The most cells that each of them trained at once.
};

Origins OriginsOf(const SweepResults& results) {
  Origins origins;
  for (const CellStatus& status : results.statuses) {
    if (!status.trained) continue;
    origins.commits.insert(status.trained->commit);
    origins.platforms.insert(status.trained->platform);
    int& most = origins.machines[status.trained->host];
    most = std::max(most, status.trained->at_once);
  }
  for (const ScoreResults& score : results.scores) {
    for (const RowScore& row : score.rows) {
      for (const CellScore& seed : row.seeds) origins.commits.insert(seed.result.commit);
    }
  }
  origins.commits.erase("");
  origins.platforms.erase("");
  origins.machines.erase("");
  return origins;
}

std::string HowTrained(const SweepSettings& sweep) {
  if (sweep.trainer == Trainer::kService) {
    return fmt::format("by a service of {} actor{}: a result depends on the machine's speed",
                       sweep.actors, sweep.actors == 1 ? "" : "s");
  }
  return sweep.lockstep ? "in lockstep: a result depends on plan and processor alone"
                        : "with threads: a result depends on the machine's speed";
}

std::vector<std::pair<std::string, std::string>> ProvenanceOf(const Plan& plan, const Cells& cells,
                                                              const SweepResults& results) {
  std::vector<std::pair<std::string, std::string>> facts;
  facts.emplace_back("Plan", plan.file.string());
  if (!plan.overrides.empty()) {
    std::vector<std::string> sets;
    for (const base::TomlAssignment& set : plan.overrides) {
      sets.push_back(set.key + "=" + set.value.text);
    }
    facts.emplace_back("Changed by --set", fmt::format("{}", fmt::join(sets, ", ")));
  }
  facts.emplace_back("Cells", ProgressText(results));
  if (std::ranges::any_of(cells.cells, [](const Cell& cell) { return cell.config.has_value(); })) {
    facts.emplace_back("Seeds", fmt::format("{}", fmt::join(plan.sweep.seeds, ", ")));
    facts.emplace_back("Budget of a training", BudgetText(cells));
    facts.emplace_back("Training", HowTrained(plan.sweep));
  }
  const Origins origins = OriginsOf(results);
  std::vector<std::string> machines;
  for (const auto& [host, most] : origins.machines) {
    machines.push_back(most > 1 ? fmt::format("{} (up to {} cells at a time)", host, most) : host);
  }
  const auto add = [&](const char* name, const char* plural, const auto& texts,
                       const char* between) {
    if (texts.empty()) return;
    facts.emplace_back(texts.size() == 1 ? name : plural,
                       fmt::format("{}", fmt::join(texts, between)));
  };
  add("Machine", "Machines", machines, ", ");
  add("Arithmetic", "Arithmetic", origins.platforms, "; ");
  add("Commit", "Commits", origins.commits, ", ");
  return facts;
}

std::vector<std::string> WarningsOf(const Plan& plan, const SweepResults& results) {
  std::vector<std::string> warnings;
  if (const int failed = results.num_cells(CellState::kFailed); failed > 0) {
    warnings.push_back(
        failed == 1
            ? "1 cell failed; the end of its log stands under Failures."
            : fmt::format("{} cells failed; the ends of their logs stand under Failures.", failed));
  }
  if (!results.missing.empty()) {
    warnings.push_back(fmt::format(
        "{} evaluation{} of the plan {} missing. Fractions, and a row's column \"seeds\", say how "
        "many seeds are in a number.",
        results.missing.size(), results.missing.size() == 1 ? "" : "s",
        results.missing.size() == 1 ? "is" : "are"));
  }
  if (plan.budget.seconds > 0.0) {
    warnings.push_back(fmt::format(
        "Each training lasted {}. What is learned in that time depends on the machine and on what "
        "else ran there.",
        base::FormatDuration(plan.budget.seconds)));
  }
  if (OriginsOf(results).commits.size() > 1) {
    warnings.push_back("The numbers are from several versions of the program.");
  }
  return warnings;
}

/// "collection barn, gazebo friction"
std::string TaskOf(const Cells& cells) {
  std::set<std::string> collections;
  std::set<std::string> frictions;
  for (const Cell& cell : cells.cells) {
    collections.insert(cell.collection.empty() ? "built-in courses"
                                               : "collection " + cell.collection);
    frictions.insert(cell.friction);
  }
  return fmt::format("{}, {} friction", fmt::join(collections, " and "),
                     fmt::join(frictions, " and "));
}

std::string OverlapOf(const SweepResults& results, const ScoreResults& score) {
  std::vector<std::string> rows;
  for (const RowScore& row : score.rows) {
    int most = 0;
    for (const CellScore& seed : row.seeds) {
      if (const auto& overlap = seed.result.training_overlap) {
        most = std::max(most, overlap->num_courses);
      }
    }
    if (most == 0) continue;
    rows.push_back(fmt::format("{} ({} of {})", results.rows[row.row].title, most,
                               row.seeds.front().result.courses.size()));
  }
  if (rows.empty()) return "";
  return fmt::format("Trained on some of these courses: {}.", fmt::join(rows, ", "));
}

/// Names the trained agent with the most success, and those whose success prints alike. Empty if
/// fewer than two have one, or all print alike.
std::string BestOf(const std::vector<eval::AgentFigures>& agents) {
  std::vector<const eval::AgentFigures*> scored;
  for (const eval::AgentFigures& agent : agents) {
    if (agent.is_trained && agent.success().estimate) scored.push_back(&agent);
  }
  if (scored.size() < 2) return "";
  const auto success = [](const eval::AgentFigures* a) { return a->success().estimate->value; };
  const auto text = [&](const auto* agent) { return eval::FixedText(100.0 * success(agent), 1); };
  const auto* best = *std::ranges::max_element(scored, {}, success);
  std::vector<std::string> names;
  for (const auto* agent : scored) {
    if (text(agent) == text(best)) names.push_back(agent->label);
  }
  if (names.size() == scored.size()) return "";
  return fmt::format(
      "Best row{}: {}, with {} % success, of {} rows. The best of many is partly so by chance: "
      "score it on other courses, or train it with other seeds, before you rely on the number.",
      names.size() == 1 ? "" : "s", fmt::join(names, "; "), text(best), scored.size());
}

/// The training of a cell, until the snapshot if the row is of one.
eval::TrainingFigures TrainingOf(const SweepResults& results, const RowScore& row,
                                 std::size_t cell) {
  if (row.snapshot_steps > 0) {
    const auto seconds = results.snapshot_seconds.find({cell, row.snapshot_steps});
    const bool is_known = seconds != results.snapshot_seconds.end();
    return {.steps = row.snapshot_steps,
            .training_s = is_known ? std::optional(seconds->second) : std::nullopt};
  }
  const std::optional<TrainedCell>& trained = results.statuses[cell].trained;
  if (!trained) return {};
  const train::PolicyFigures total = trained->total();
  return {.steps = total.steps,
          .updates = total.updates,
          .imagined = trained->imagined,
          .training_s = total.training_s};
}

/// `AgentOf`, with its trainings.
eval::Agent TrainedAgentOf(const SweepResults& results, const RowScore& row) {
  eval::Agent agent = AgentOf(results, row);
  agent.trainings.emplace();
  for (const CellScore& seed : row.seeds) {
    agent.trainings->push_back(TrainingOf(results, row, seed.cell));
  }
  return agent;
}

/// The quantities of the tables.
std::vector<std::size_t> Columns() {
  std::vector<std::size_t> columns;
  for (std::size_t q = 0; q < eval::Quantities().size(); ++q) {
    const eval::Quantity& quantity = eval::Quantities()[q];
    const bool is_usual = std::ranges::count(kUsualQuantities, quantity.key) > 0;
    if (is_usual || quantity.aggregate != eval::Aggregate::kMean) columns.push_back(q);
  }
  return columns;
}

/// The numbers that the plan has of a row, in its order.
std::vector<eval::PublishedNumber> PublishedOf(const Plan& plan, const std::string& score,
                                               const std::string& row) {
  std::vector<eval::PublishedNumber> published;
  for (const Reference& reference : plan.references) {
    if (reference.score != score) continue;
    for (std::size_t i = 0; i < reference.rows.size(); ++i) {
      if (reference.rows[i] != row) continue;
      const double deviation = reference.deviations.empty() ? 0.0 : reference.deviations[i];
      published.push_back({*eval::FindQuantity(reference.quantity), reference.source,
                           reference.values[i],
                           deviation > 0.0 ? std::optional(deviation) : std::nullopt});
    }
  }
  return published;
}

ScoreContent MakeScore(const Plan& plan, const Cells& cells, const SweepResults& results,
                       std::size_t place) {
  const ScoreResults& score = results.scores[place];
  ScoreContent content{
      .name = score.name, .label = score.label, .courses = plan.scores[place].courses};
  std::vector<eval::Agent> agents;
  for (const RowScore& row : score.rows) {
    eval::Agent& agent = agents.emplace_back(TrainedAgentOf(results, row));
    agent.published = PublishedOf(plan, score.name, results.rows[row.row].name);
    content.rows.push_back(row.row);
  }
  eval::CompareOptions options;
  options.columns = {0};  // Pairs are compared by success alone.
  content.group = eval::CompareAgents(agents, options);
  content.group.columns = Columns();
  const auto note = [&](std::string text) {
    if (!text.empty()) content.group.notes.push_back(std::move(text));
  };
  if (!cells.axis_names.empty()) note(BestOf(content.group.agents));
  if (content.courses != "training") note(OverlapOf(results, score));
  for (const RowScore& row : score.snapshots) {
    eval::Agent agent = TrainedAgentOf(results, row);
    agent.label += row.snapshot_steps > 0
                       ? fmt::format(", after {} steps", base::FormatCount(row.snapshot_steps))
                       : ", at the end";
    content.snapshots.push_back(eval::FiguresOf(agent));
    content.snapshot_rows.push_back({row.row, row.snapshot_steps});
  }
  content.curves = LearningCurves(results, score);
  return content;
}

std::string Describe(const MissingScore& missing, const Cells& cells) {
  std::string snapshot;
  if (missing.snapshot_steps > 0) {
    snapshot = fmt::format(" after {} steps", base::FormatCount(missing.snapshot_steps));
  }
  return fmt::format("{}, {}{}: {}", cells.cells[missing.cell].name(), missing.score, snapshot,
                     missing.why);
}

}  // namespace

ReportContent MakeContent(const Plan& plan, const Cells& cells, const fs::path& store) {
  ReportContent content{plan, cells, CollectResults(plan, cells, store), {}, {}, {}, {}, {}, {}};
  content.title = fmt::format(
      "{} ({})", plan.sweep.title.empty() ? plan.sweep.name : plan.sweep.title, TaskOf(cells));
  content.provenance = ProvenanceOf(plan, cells, content.results);
  content.warnings = WarningsOf(plan, content.results);
  for (std::size_t s = 0; s < plan.scores.size(); ++s) {
    content.scores.push_back(MakeScore(plan, cells, content.results, s));
  }
  content.conclusions = JudgeConclusions(plan, content.results);
  for (const MissingScore& missing : content.results.missing) {
    content.missing.push_back(Describe(missing, cells));
  }
  return content;
}

}  // namespace slalom::sweep
