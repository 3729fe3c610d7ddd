#include "app/sweep/report/report_content.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <map>
#include <numeric>
#include <set>

#include "app/train/resolved_run.h"
#include "base/progress.h"
#include "eval/report/table_text.h"

namespace slalom::sweep {
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

bool HasTrainings(const Cells& cells) {
  return std::ranges::any_of(cells.cells, [](const Cell& cell) { return cell.config.has_value(); });
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

/// The commits of all programs that trained or evaluated.
std::set<std::string> CommitsOf(const SweepResults& results) {
  std::set<std::string> commits;
  for (const CellStatus& status : results.statuses) {
    if (status.trained) commits.insert(status.trained->commit);
  }
  for (const ScoreResults& score : results.scores) {
    for (const RowScore& row : score.rows) {
      for (const CellScore& seed : row.seeds) commits.insert(seed.result.commit);
    }
  }
  commits.erase("");
  return commits;
}

std::set<std::string> PlatformsOf(const SweepResults& results) {
  std::set<std::string> platforms;
  for (const CellStatus& status : results.statuses) {
    if (status.trained) platforms.insert(status.trained->platform);
  }
  platforms.erase("");
  return platforms;
}

/// "node-1 (4 cells at a time)" for each machine that trained.
std::set<std::string> MachinesOf(const SweepResults& results) {
  std::map<std::string, int> most_at_once;
  for (const CellStatus& status : results.statuses) {
    if (!status.trained || status.trained->host.empty()) continue;
    int& most = most_at_once[status.trained->host];
    most = std::max(most, status.trained->at_once);
  }
  std::set<std::string> machines;
  for (const auto& [host, most] : most_at_once) {
    machines.insert(most > 1 ? fmt::format("{} (up to {} cells at a time)", host, most) : host);
  }
  return machines;
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
  if (HasTrainings(cells)) {
    facts.emplace_back("Seeds", fmt::format("{}", fmt::join(plan.sweep.seeds, ", ")));
    facts.emplace_back("Budget of a training", BudgetText(cells));
    facts.emplace_back("Training", HowTrained(plan.sweep));
  }
  const auto machines = MachinesOf(results);
  if (!machines.empty()) {
    facts.emplace_back(machines.size() == 1 ? "Machine" : "Machines",
                       fmt::format("{}", fmt::join(machines, ", ")));
  }
  const auto platforms = PlatformsOf(results);
  if (!platforms.empty()) {
    facts.emplace_back("Arithmetic", fmt::format("{}", fmt::join(platforms, "; ")));
  }
  const auto commits = CommitsOf(results);
  if (!commits.empty()) {
    facts.emplace_back(commits.size() == 1 ? "Commit" : "Commits",
                       fmt::format("{}", fmt::join(commits, ", ")));
  }
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
  if (CommitsOf(results).size() > 1) {
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

std::optional<double> MeanOf(const std::vector<double>& values) {
  if (values.empty()) return std::nullopt;
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

TrainingFigures TrainingOf(const SweepResults& results, const RowScore& row) {
  std::vector<double> steps;
  std::vector<double> updates;
  std::vector<double> imagined;
  std::vector<double> seconds;
  for (const CellScore& seed : row.seeds) {
    if (row.snapshot_steps > 0) {
      steps.push_back(static_cast<double>(row.snapshot_steps));
      const auto found = results.snapshot_seconds.find({seed.cell, row.snapshot_steps});
      if (found != results.snapshot_seconds.end()) seconds.push_back(found->second);
      continue;
    }
    const std::optional<TrainedCell>& trained = results.statuses[seed.cell].trained;
    if (!trained) continue;
    const train::PolicyFigures total = trained->total();
    steps.push_back(static_cast<double>(total.steps));
    updates.push_back(static_cast<double>(total.updates));
    if (trained->imagined) imagined.push_back(static_cast<double>(*trained->imagined));
    seconds.push_back(total.training_s);
  }
  return {MeanOf(steps), MeanOf(updates), MeanOf(imagined), MeanOf(seconds)};
}

Snapshot SnapshotOf(const SweepResults& results, const RowScore& row) {
  eval::Agent agent = AgentOf(results, row);
  agent.label += row.snapshot_steps > 0
                     ? fmt::format(", after {} steps",
                                   base::FormatCount(static_cast<double>(row.snapshot_steps)))
                     : ", at the end";
  return {row.row, row.snapshot_steps, eval::FiguresOf(agent), TrainingOf(results, row)};
}

/// The quantities of the tables.
std::vector<std::size_t> Columns() {
  std::vector<std::size_t> columns;
  for (const char* key : {"success_rate", "success_rate_iqm", "success_rate_worst",
                          "collision_rate", "survival_time_s", "traversal_time_s"}) {
    columns.push_back(*eval::FindQuantity(key));
  }
  return columns;
}

ScoreContent MakeScore(const Cells& cells, const SweepResults& results, const ScoreResults& score,
                       const std::string& courses) {
  ScoreContent content{score.name, score.label, courses, {}, {}, {}, {}, {}};
  std::vector<eval::Agent> agents;
  for (const RowScore& row : score.rows) {
    agents.push_back(AgentOf(results, row));
    content.rows.push_back(row.row);
    content.trainings.push_back(TrainingOf(results, row));
  }
  eval::CompareOptions options;
  options.columns = {0};  // Pairs are compared by success alone.
  content.group = eval::CompareAgents(agents, options);
  content.group.columns = Columns();
  const auto note = [&](std::string text) {
    if (!text.empty()) content.group.notes.push_back(std::move(text));
  };
  if (!cells.axis_names.empty()) note(BestOf(content.group.agents));
  if (courses != "training") note(OverlapOf(results, score));
  for (const RowScore& row : score.snapshots) {
    content.snapshots.push_back(SnapshotOf(results, row));
  }
  content.curves = LearningCurves(results, score);
  return content;
}

}  // namespace

ReportContent MakeContent(const Plan& plan, const Cells& cells, const fs::path& store) {
  ReportContent content{plan, cells, CollectResults(plan, cells, store), {}, {}, {}, {}, {}};
  content.title = fmt::format(
      "{} ({})", plan.sweep.title.empty() ? plan.sweep.name : plan.sweep.title, TaskOf(cells));
  content.provenance = ProvenanceOf(plan, cells, content.results);
  content.warnings = WarningsOf(plan, content.results);
  for (std::size_t s = 0; s < plan.scores.size(); ++s) {
    content.scores.push_back(
        MakeScore(cells, content.results, content.results.scores[s], plan.scores[s].courses));
  }
  content.conclusions = JudgeConclusions(plan, content.results);
  return content;
}

std::vector<Published> FindPublished(const Plan& plan, const std::string& score,
                                     const std::string& row, const eval::Quantity& quantity) {
  std::vector<Published> published;
  for (const Reference& reference : plan.references) {
    if (reference.score != score || reference.quantity != quantity.key) continue;
    for (std::size_t i = 0; i < reference.rows.size(); ++i) {
      if (reference.rows[i] != row || i >= reference.values.size()) continue;
      const bool has_deviation = i < reference.deviations.size() && reference.deviations[i] > 0.0;
      published.push_back({reference.source, reference.values[i],
                           has_deviation ? std::optional(reference.deviations[i]) : std::nullopt});
    }
  }
  return published;
}

std::string Describe(const MissingScore& missing, const Cells& cells) {
  const std::string snapshot =
      missing.snapshot_steps > 0
          ? fmt::format(" after {} steps",
                        base::FormatCount(static_cast<double>(missing.snapshot_steps)))
          : "";
  return fmt::format("{}, {}{}: {}", cells.cells[missing.cell].name(), missing.score, snapshot,
                     missing.why);
}

}  // namespace slalom::sweep
