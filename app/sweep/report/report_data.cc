#include <fmt/format.h>
#include <fmt/ranges.h>

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

using eval::JsonOf;
using Fields = std::vector<std::string>;
using Json = nlohmann::json;

std::string LineOf(Fields fields) {
  for (std::string& field : fields) field = eval::CsvField(field);
  return fmt::format("{}", fmt::join(fields, ","));
}

std::string Field(const std::optional<double>& number) {
  return number ? fmt::format("{:.6g}", *number) : "";
}

std::string StepsField(std::int64_t steps) { return steps > 0 ? fmt::format("{}", steps) : ""; }

/// "row", then a column for each axis.
std::string LabelHead(const Cells& cells) {
  Fields fields = cells.axis_names;
  fields.insert(fields.begin(), "row");
  return LineOf(std::move(fields));
}

/// The fields below `LabelHead`.
std::string LabelFields(const Row& row, const Cells& cells) {
  Fields fields = row.labels;
  fields.resize(cells.axis_names.size());
  fields.insert(fields.begin(), row.name);
  return LineOf(std::move(fields));
}

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

/// Of one evaluation, which may be null: courses, episodes and means. Of no evaluation: the heads.
Fields ResultFields(const eval::Result* result, bool is_head = false) {
  Fields fields(2);
  if (is_head) fields = {"courses", "episodes"};
  if (result) {
    fields = {fmt::format("{}", result->courses.size()),
              fmt::format("{}", result->set.num_episodes)};
  }
  for (const eval::Quantity& quantity : eval::Quantities()) {
    if (quantity.aggregate != eval::Aggregate::kMean) continue;
    fields.push_back(is_head  ? std::string(quantity.key)
                     : result ? Field(eval::ValueOf(*result, quantity))
                              : "");
  }
  return fields;
}

Fields TrainingFields(const std::optional<TrainedCell>& trained) {
  if (!trained) return Fields(7);
  const train::PolicyFigures total = trained->total();
  return {fmt::format("{}", total.steps),
          fmt::format("{}", total.updates),
          trained->imagined ? fmt::format("{}", *trained->imagined) : "",
          Field(total.training_s),
          trained->host,
          fmt::format("{}", trained->at_once),
          trained->commit};
}

// ---- The page

Json CurveJson(const LearningCurve& curve) {
  Json points = Json::array();
  for (const LearningCurve::Point& point : curve.points) {
    points.push_back({{"steps", point.steps},
                      {"seconds", JsonOf(point.seconds)},
                      {"success", JsonOf(point.success)}});
  }
  return {{"agent", curve.agent},
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
  for (std::size_t i = 0; i < score.rows.size(); ++i) {
    json["group"]["agents"][i].update(
        {{"row", score.rows[i]}, {"labels", content.results.rows[score.rows[i]].labels}});
  }
  for (const LearningCurve& curve : score.curves) json["curves"].push_back(CurveJson(curve));
  return json;
}

}  // namespace

std::string CellCsv(const ReportContent& content) {
  std::string text = fmt::format(
      "id,group,{},seed,score,snapshot_steps,state,{},steps,updates,imagined,training_s,host,"
      "at_once,commit\n",
      LabelHead(content.cells), LineOf(ResultFields(nullptr, true)));
  const Evaluations evaluations = EvaluationsOf(content.results);
  for (const Row& row : content.results.rows) {
    for (const std::size_t c : row.cells) {
      const Cell& cell = content.cells.cells[c];
      const CellStatus& status = content.results.statuses[c];
      for (const ScoreTask& task : cell.scores) {
        const auto found = evaluations.find({c, task.name, task.snapshot_steps});
        const eval::Result* result = found == evaluations.end() ? nullptr : found->second;
        text +=
            fmt::format("{},{},{},{},{},{},{},{},{}\n", cell.id, eval::CsvField(cell.group),
                        LabelFields(row, content.cells), cell.seed, eval::CsvField(task.name),
                        StepsField(task.snapshot_steps), result ? "done" : ToString(status.state),
                        LineOf(ResultFields(result)), LineOf(TrainingFields(status.trained)));
      }
    }
  }
  return text;
}

std::string RowCsv(const ReportContent& content) {
  std::string text = fmt::format("{},score,snapshot_steps,{},steps,updates,imagined,training_s\n",
                                 LabelHead(content.cells), eval::FiguresCsvHead());
  for (const ScoreContent& score : content.scores) {
    const auto add = [&](const SnapshotRow& row, const eval::AgentFigures& agent) {
      const eval::TrainingFigures& training = *agent.training;
      text += fmt::format(
          "{},{},{},{},{},{},{},{}\n", LabelFields(content.results.rows[row.row], content.cells),
          eval::CsvField(score.name), StepsField(row.steps), eval::FiguresCsvFields(agent),
          Field(training.steps), Field(training.updates), Field(training.imagined),
          Field(training.training_s));
    };
    for (std::size_t i = 0; i < score.rows.size(); ++i) {
      add({score.rows[i]}, score.group.agents[i]);
    }
    for (std::size_t i = 0; i < score.snapshots.size(); ++i) {
      if (score.snapshot_rows[i].steps > 0) add(score.snapshot_rows[i], score.snapshots[i]);
    }
  }
  return text;
}

std::string SweepPage(const ReportContent& content) {
  Json data = {{"title", content.title},
               {"provenance", content.provenance},
               {"warnings", content.warnings},
               {"axes", content.cells.axis_names},
               {"scores", Json::array()},
               {"quantities", eval::QuantitiesJson()},
               {"missing", content.missing},
               {"failures", Json::array()},
               {"thresholds", eval::ProfileThresholds()}};
  for (const ScoreContent& score : content.scores) {
    data["scores"].push_back(ScoreJson(content, score));
  }
  for (std::size_t c = 0; c < content.results.statuses.size(); ++c) {
    const CellStatus& status = content.results.statuses[c];
    if (status.state != CellState::kFailed || !status.failure) continue;
    data["failures"].push_back({{"cell", content.cells.cells[c].name()},
                                {"id", content.cells.cells[c].id},
                                {"what", status.failure->what},
                                {"log", status.failure->log}});
  }
  return eval::FillPage(kSweepPage, eval::JsonForPage(data));
}

}  // namespace slalom::sweep
