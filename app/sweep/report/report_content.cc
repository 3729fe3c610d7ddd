#include "app/sweep/report/report_content.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "app/train/resolved_run.h"
#include "base/progress.h"
#include "eval/report/comparison.h"
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
  if (!seconds.empty()) texts.push_back(Span(seconds, FormatSeconds) + " of training time");
  return fmt::format("{}", fmt::join(texts, ", "));
}

bool HasTrainings(const Cells& cells) {
  return std::ranges::any_of(cells.cells, [](const Cell& cell) { return cell.config.has_value(); });
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
    warnings.push_back(fmt::format("{} cell{} failed; the end of {} below.", failed,
                                   failed == 1 ? "" : "s",
                                   failed == 1 ? "its log stands" : "their logs stands"));
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
        FormatSeconds(plan.budget.seconds)));
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

std::string ProtocolOf(const ScoreResults& score) {
  for (const RowScore& row : score.rows) {
    if (!row.seeds.empty()) return eval::ProtocolSentence(row.seeds.front().result);
  }
  return "";
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
    rows.push_back(fmt::format("{} ({} of {})", results.rows[row.row].name, most,
                               row.seeds.front().result.courses.size()));
  }
  if (rows.empty()) return "";
  return fmt::format("Trained on some of these courses: {}.", fmt::join(rows, ", "));
}

/// Rows whose success prints alike are all named.
std::string BestRowOf(const Cells& cells, const SweepResults& results,
                      const std::vector<RowFigures>& rows) {
  if (cells.axis_names.empty()) return "";
  const auto success = [](const RowFigures& row) { return row.quantities[0].estimate; };
  std::vector<const RowFigures*> scored;
  for (const RowFigures& row : rows) {
    if (success(row) && !results.rows[row.row].is_planner) scored.push_back(&row);
  }
  if (scored.size() < 2) return "";
  const auto text = [&](const RowFigures* row) {
    return eval::FixedText(100.0 * success(*row)->value, 1);
  };
  const RowFigures* best = *std::ranges::max_element(
      scored, {}, [&](const RowFigures* row) { return success(*row)->value; });
  std::vector<std::string> names;
  for (const RowFigures* row : scored) {
    if (text(row) == text(best)) names.push_back(results.rows[row->row].title);
  }
  if (names.size() == scored.size()) return "";
  return fmt::format(
      "Best row{}: {}, with {} % success, of {} rows. The best of many is partly so by chance: "
      "score "
      "it on other courses, or train it with other seeds, before you rely on the number.",
      names.size() == 1 ? "" : "s", fmt::join(names, "; "), text(best), scored.size());
}

ScoreContent MakeScore(const Plan& plan, const Cells& cells, const SweepResults& results,
                       const ScoreResults& score, const std::string& courses) {
  ScoreContent content;
  content.name = score.name;
  content.label = score.label;
  content.courses = courses;
  content.protocol = ProtocolOf(score);
  if (courses != "training") content.overlap = OverlapOf(results, score);
  for (const RowScore& row : score.rows) {
    content.rows.push_back(FiguresOf(plan, results, score.name, row));
  }
  for (const RowScore& row : score.snapshots) {
    RowFigures figures = FiguresOf(plan, results, score.name, row);
    // Published numbers are of finished policies, whose table has them.
    for (auto& published : figures.published) published.clear();
    content.snapshots.push_back(std::move(figures));
    content.snapshot_steps.push_back(row.snapshot_steps);
  }
  content.best_row = BestRowOf(cells, results, content.rows);
  content.curves = LearningCurves(results, score);
  content.profiles = ProfilesOf(score);
  content.pairs = CompareRows(score);
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
        MakeScore(plan, cells, content.results, content.results.scores[s], plan.scores[s].courses));
  }
  content.conclusions = JudgeConclusions(plan, content.results);
  return content;
}

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

std::string Describe(const MissingScore& missing, const Cells& cells) {
  const std::string snapshot =
      missing.snapshot_steps > 0
          ? fmt::format(" after {} steps",
                        base::FormatCount(static_cast<double>(missing.snapshot_steps)))
          : "";
  return fmt::format("{}, {}{}: {}", cells.cells[missing.cell].name(), missing.score, snapshot,
                     missing.why);
}

std::string FormatSeconds(double seconds) {
  const auto whole = static_cast<std::int64_t>(std::llround(seconds));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
}

std::vector<PublishedColumn> PublishedColumns(std::span<const RowFigures> rows) {
  std::vector<PublishedColumn> columns;
  for (std::size_t q = 0; q < std::size(kQuantities); ++q) {
    std::vector<std::string> sources;
    for (const RowFigures& row : rows) {
      for (const Published& published : row.published[q]) {
        if (std::ranges::find(sources, published.source) == sources.end()) {
          sources.push_back(published.source);
        }
      }
    }
    for (std::string& source : sources) columns.push_back({q, std::move(source)});
  }
  return columns;
}

std::optional<Published> FindPublished(const RowFigures& row, const PublishedColumn& column) {
  const auto& published = row.published[column.quantity];
  const auto found = std::ranges::find(published, column.source, &Published::source);
  return found == published.end() ? std::nullopt : std::optional(*found);
}

}  // namespace slalom::sweep
