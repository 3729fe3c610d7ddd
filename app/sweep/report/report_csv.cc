#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <tuple>

#include "app/sweep/report/report.h"
#include "eval/csv_field.h"
#include "eval/report/table_text.h"

namespace slalom::sweep {
namespace {

using eval::CsvField;

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

/// value, low, high.
std::string EstimateFields(const std::optional<eval::Estimate>& estimate) {
  if (!estimate) return ",,";
  if (!estimate->interval) return fmt::format("{:.6g},,", estimate->value);
  return fmt::format("{:.6g},{:.6g},{:.6g}", estimate->value, estimate->interval->low,
                     estimate->interval->high);
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

std::string ResultFields(const eval::Result* result) {
  std::string fields = result
                           ? fmt::format("{},{}", result->courses.size(), result->set.num_episodes)
                           : std::string(",");
  for (const Quantity& quantity : kQuantities) {
    fields += "," + (result ? Field(ValueOf(*result, quantity)) : "");
  }
  fields += "," + (result ? Field(result->set.timeout_rate.value) : "");
  fields += "," + (result ? Field(result->set.barn_score.value) : "");
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

/// Sources of published numbers in the plan's order.
std::vector<std::string> SourcesOf(const Plan& plan) {
  std::vector<std::string> sources;
  for (const Reference& reference : plan.references) {
    if (std::ranges::find(sources, reference.source) == sources.end()) {
      sources.push_back(reference.source);
    }
  }
  return sources;
}

std::string RowLine(const ReportContent& content, const ScoreContent& score, const RowFigures& row,
                    std::int64_t snapshot_steps, const std::vector<std::string>& sources) {
  std::string line = LabelFields(content.row(row), content.cells);
  fmt::format_to(std::back_inserter(line), ",{},{},{},{},{},{}", CsvField(score.name),
                 snapshot_steps > 0 ? fmt::format("{}", snapshot_steps) : "", row.num_seeds,
                 row.num_planned, row.num_courses, row.num_episodes);
  for (const QuantityFigures& figures : row.quantities) {
    line += "," + EstimateFields(figures.estimate) + "," + Field(figures.seed_mean) + "," +
            Field(figures.seed_deviation);
  }
  line += "," + EstimateFields(row.interquartile_mean);
  line += "," + EstimateFields(row.lowest_twentieth);
  line += "," + Field(row.steps) + "," + Field(row.updates) + "," + Field(row.imagined) + "," +
          Field(row.training_s);
  for (const std::string& source : sources) {
    const bool has_any = std::ranges::any_of(row.published, [&](const auto& published) {
      return std::ranges::find(published, source, &Published::source) != published.end();
    });
    line += "," + (has_any ? CsvField(source) : "");
    for (std::size_t q = 0; q < std::size(kQuantities); ++q) {
      const auto published = FindPublished(row, {q, source});
      line += "," + (published ? Field(published->value) : "") + "," +
              (published ? Field(published->deviation) : "");
    }
  }
  return line + "\n";
}

}  // namespace

std::string CellCsv(const ReportContent& content) {
  std::string text = "id,group," + LabelHead(content.cells) + ",seed,score,snapshot_steps,state";
  text += ",courses,episodes";
  for (const Quantity& quantity : kQuantities) text += "," + std::string(quantity.key);
  text += ",timeout_rate,barn_score,steps,updates,imagined,training_s,host,at_once,commit\n";
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
                       CsvField(task.name),
                       task.snapshot_steps > 0 ? fmt::format("{}", task.snapshot_steps) : "",
                       result ? "done" : ToString(status.state), ResultFields(result),
                       TrainingFields(status.trained));
      }
    }
  }
  return text;
}

std::string RowCsv(const ReportContent& content) {
  const std::vector<std::string> sources = SourcesOf(content.plan);
  std::string text = LabelHead(content.cells) + ",score,snapshot_steps,seeds,planned_seeds";
  text += ",courses,episodes";
  for (const Quantity& quantity : kQuantities) {
    fmt::format_to(std::back_inserter(text), ",{0},{0}_low,{0}_high,{0}_seed_mean,{0}_deviation",
                   quantity.key);
  }
  text +=
      ",success_iqm,success_iqm_low,success_iqm_high,success_worst,success_worst_low,success_worst_"
      "high,steps,updates,imagined,training_s";
  for (std::size_t s = 0; s < sources.size(); ++s) {
    const std::string prefix = s == 0 ? "published" : fmt::format("published_{}", s + 1);
    text += "," + prefix;
    for (const Quantity& quantity : kQuantities) {
      fmt::format_to(std::back_inserter(text), ",{0}_{1},{0}_{1}_deviation", prefix, quantity.key);
    }
  }
  text += "\n";
  for (const ScoreContent& score : content.scores) {
    for (const RowFigures& row : score.rows) text += RowLine(content, score, row, 0, sources);
    for (std::size_t i = 0; i < score.snapshots.size(); ++i) {
      if (score.snapshot_steps[i] == 0) continue;
      text += RowLine(content, score, score.snapshots[i], score.snapshot_steps[i], sources);
    }
  }
  return text;
}

}  // namespace slalom::sweep
