#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <tuple>

#include "app/sweep/report/report.h"
#include "eval/comparison/printers.h"
#include "eval/csv_field.h"
#include "eval/report/embedded_page.h"

/// The report as data: CSV, and the JSON of the page.

namespace slalom::sweep {

extern const std::string_view kSweepPage;  // An embedded page.

namespace {

using eval::CsvField;
using eval::JsonOf;
using Json = nlohmann::json;

/// "row", then a column for each axis.
std::string LabelHead(const Cells& cells) {
  std::string head = "row";
  for (const std::string& axis : cells.axis_names) head += "," + CsvField(axis);
  return head;
}

/// The fields below `LabelHead`.
std::string LabelFields(const Row& row, const Cells& cells) {
  std::string fields = CsvField(row.name);
  for (std::size_t a = 0; a < cells.axis_names.size(); ++a) {
    fields += "," + (a < row.labels.size() ? CsvField(row.labels[a]) : "");
  }
  return fields;
}

std::string Field(const std::optional<double>& number) {
  return number ? fmt::format("{:.6g}", *number) : "";
}

std::string StepsField(std::int64_t steps) { return steps > 0 ? fmt::format("{}", steps) : ""; }

/// Evaluations by cell, score and snapshot.
using Evaluations =
    std::map<std::tuple<std::size_t, std::string, std::int64_t>, const eval::Result*>;

Evaluations EvaluationsOf(const SweepResults& results) {
  Evaluations evaluations;
  for (const ScoreResults& score : results.scores) {
    for (const auto* rows : {&score.rows, &score.snapshots}) {
      for (const RowScore& row : *rows) {
        for (const CellScore& seed : row.seeds) {
          evaluations[{seed.cell, score.name, row.snapshot_steps}] = &seed.result;
        }
      }
    }
  }
  return evaluations;
}

/// The quantities of a single evaluation.
std::vector<const eval::Quantity*> Means() {
  std::vector<const eval::Quantity*> means;
  for (const eval::Quantity& quantity : eval::Quantities()) {
    if (quantity.aggregate == eval::Aggregate::kMean) means.push_back(&quantity);
  }
  return means;
}

std::string ResultFields(const eval::Result* result) {
  std::string fields = result
                           ? fmt::format("{},{}", result->courses.size(), result->set.num_episodes)
                           : std::string(",");
  for (const eval::Quantity* quantity : Means()) {
    fields += "," + (result ? Field(eval::ValueOf(*result, *quantity)) : "");
  }
  return fields;
}

std::string TrainingFields(const std::optional<TrainedCell>& trained) {
  if (!trained) return ",,,,,,";
  const train::PolicyFigures total = trained->total();
  return fmt::format("{},{},{},{:.6g},{},{},{}", total.steps, total.updates,
                     trained->imagined ? fmt::format("{}", *trained->imagined) : "",
                     total.training_s, CsvField(trained->host), trained->at_once,
                     CsvField(trained->commit));
}

std::string RowLine(const ReportContent& content, const ScoreContent& score, std::size_t row,
                    std::int64_t snapshot_steps, const eval::AgentFigures& agent,
                    const TrainingFigures& training) {
  return fmt::format("{},{},{},{},{},{},{},{}\n",
                     LabelFields(content.results.rows[row], content.cells), CsvField(score.name),
                     StepsField(snapshot_steps), eval::FiguresCsvFields(agent),
                     Field(training.steps), Field(training.updates), Field(training.imagined),
                     Field(training.training_s));
}

// ---- The page

/// Adds what only a sweep knows to the JSON of a score's agents.
void AddRows(const ReportContent& content, const ScoreContent& score, Json& agents) {
  for (std::size_t i = 0; i < score.rows.size(); ++i) {
    const Row& row = content.results.rows[score.rows[i]];
    const TrainingFigures& training = score.trainings[i];
    agents[i].update({{"row", score.rows[i]},
                      {"labels", row.labels},
                      {"steps", JsonOf(training.steps)},
                      {"imagined", JsonOf(training.imagined)},
                      {"training_s", JsonOf(training.training_s)},
                      {"published", Json::object()}});
    for (const eval::Quantity& quantity : eval::Quantities()) {
      Json& list = agents[i]["published"][std::string(quantity.key)] = Json::array();
      for (const Published& one : FindPublished(content.plan, score.name, row.name, quantity)) {
        list.push_back(
            {{"source", one.source}, {"value", one.value}, {"deviation", JsonOf(one.deviation)}});
      }
    }
  }
}

Json CurveJson(const ReportContent& content, const LearningCurve& curve) {
  Json points = Json::array();
  for (const LearningCurve::Point& point : curve.points) {
    points.push_back({{"steps", point.steps},
                      {"seconds", JsonOf(point.seconds)},
                      {"success", JsonOf(point.success)}});
  }
  return {{"row", curve.row},
          {"label", content.results.rows[curve.row].title},
          {"seeds", curve.num_seeds},
          {"planned", curve.num_planned},
          {"points", std::move(points)},
          {"area_over_steps", JsonOf(curve.area_over_steps)},
          {"area_over_seconds", JsonOf(curve.area_over_seconds)}};
}

Json ScoreJson(const ReportContent& content, const ScoreContent& score) {
  Json json = {{"name", score.name},
               {"label", score.label},
               {"courses", score.courses},
               {"group", JsonOf(score.group)},
               {"curves", Json::array()}};
  AddRows(content, score, json["group"]["agents"]);
  for (const LearningCurve& curve : score.curves) {
    json["curves"].push_back(CurveJson(content, curve));
  }
  return json;
}

Json FailuresJson(const ReportContent& content) {
  Json failures = Json::array();
  for (std::size_t c = 0; c < content.results.statuses.size(); ++c) {
    const CellStatus& status = content.results.statuses[c];
    if (status.state != CellState::kFailed || !status.failure) continue;
    failures.push_back({{"cell", content.cells.cells[c].name()},
                        {"id", content.cells.cells[c].id},
                        {"what", status.failure->what},
                        {"log", status.failure->log}});
  }
  return failures;
}

}  // namespace

std::string CellCsv(const ReportContent& content) {
  std::string text = "id,group," + LabelHead(content.cells) + ",seed,score,snapshot_steps,state";
  text += ",courses,episodes";
  for (const eval::Quantity* quantity : Means()) text += "," + std::string(quantity->key);
  text += ",steps,updates,imagined,training_s,host,at_once,commit\n";
  const Evaluations evaluations = EvaluationsOf(content.results);
  for (const Row& row : content.results.rows) {
    for (const std::size_t c : row.cells) {
      const Cell& cell = content.cells.cells[c];
      const CellStatus& status = content.results.statuses[c];
      for (const ScoreTask& task : cell.scores) {
        const auto found = evaluations.find({c, task.name, task.snapshot_steps});
        const eval::Result* result = found == evaluations.end() ? nullptr : found->second;
        fmt::format_to(std::back_inserter(text), "{},{},{},{},{},{},{},{},{}\n", cell.id,
                       CsvField(cell.group), LabelFields(row, content.cells), cell.seed,
                       CsvField(task.name), StepsField(task.snapshot_steps),
                       result ? "done" : ToString(status.state), ResultFields(result),
                       TrainingFields(status.trained));
      }
    }
  }
  return text;
}

std::string RowCsv(const ReportContent& content) {
  std::string text = fmt::format("{},score,snapshot_steps,{},steps,updates,imagined,training_s\n",
                                 LabelHead(content.cells), eval::FiguresCsvHead());
  for (const ScoreContent& score : content.scores) {
    for (std::size_t i = 0; i < score.rows.size(); ++i) {
      text += RowLine(content, score, score.rows[i], 0, score.group.agents[i], score.trainings[i]);
    }
    for (const Snapshot& snapshot : score.snapshots) {
      if (snapshot.steps == 0) continue;
      text +=
          RowLine(content, score, snapshot.row, snapshot.steps, snapshot.agent, snapshot.training);
    }
  }
  return text;
}

std::string SweepPage(const ReportContent& content) {
  Json data = {{"title", content.title},           {"provenance", content.provenance},
               {"warnings", content.warnings},     {"axes", content.cells.axis_names},
               {"scores", Json::array()},          {"quantities", eval::QuantitiesJson()},
               {"missing", Json::array()},         {"thresholds", eval::ProfileThresholds()},
               {"failures", FailuresJson(content)}};
  for (const ScoreContent& score : content.scores) {
    data["scores"].push_back(ScoreJson(content, score));
  }
  for (const MissingScore& missing : content.results.missing) {
    data["missing"].push_back(Describe(missing, content.cells));
  }
  return eval::FillPage(kSweepPage, eval::JsonForPage(data));
}

}  // namespace slalom::sweep
