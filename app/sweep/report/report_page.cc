#include <algorithm>
#include <nlohmann/json.hpp>

#include "app/sweep/report/report.h"
#include "eval/report/embedded_page.h"

namespace slalom::sweep {

extern const std::string_view kSweepPage;  // An embedded page.

namespace {

using PageJson = nlohmann::json;

using eval::JsonOf;

PageJson RowJson(const RowFigures& row, const std::vector<RowScore>& results) {
  PageJson figures = PageJson::object();
  PageJson published = PageJson::object();
  for (std::size_t q = 0; q < std::size(kQuantities); ++q) {
    const std::string key(kQuantities[q].key);
    figures[key] = {{"estimate", JsonOf(row.quantities[q].estimate)},
                    {"mean", JsonOf(row.quantities[q].seed_mean)},
                    {"deviation", JsonOf(row.quantities[q].seed_deviation)}};
    published[key] = PageJson::array();
    for (const Published& one : row.published[q]) {
      published[key].push_back(
          {{"source", one.source}, {"value", one.value}, {"deviation", JsonOf(one.deviation)}});
    }
  }
  PageJson seeds = PageJson::array();
  for (const CellScore& seed : std::ranges::find(results, row.row, &RowScore::row)->seeds) {
    seeds.push_back(seed.result.set.success_rate.value);
  }
  return {{"row", row.row},
          {"seeds", row.num_seeds},
          {"planned", row.num_planned},
          {"courses", row.num_courses},
          {"episodes", row.num_episodes},
          {"figures", std::move(figures)},
          {"published", std::move(published)},
          {"iqm", JsonOf(row.interquartile_mean)},
          {"worst", JsonOf(row.lowest_twentieth)},
          {"seed_success", std::move(seeds)},
          {"steps", JsonOf(row.steps)},
          {"updates", JsonOf(row.updates)},
          {"imagined", JsonOf(row.imagined)},
          {"training_s", JsonOf(row.training_s)}};
}

PageJson CurveJson(const LearningCurve& curve) {
  PageJson points = PageJson::array();
  for (const LearningCurve::Point& point : curve.points) {
    points.push_back({{"steps", point.steps},
                      {"seconds", JsonOf(point.seconds)},
                      {"success", JsonOf(point.success)}});
  }
  return {{"row", curve.row},
          {"seeds", curve.num_seeds},
          {"planned", curve.num_planned},
          {"points", std::move(points)},
          {"area_over_steps", JsonOf(curve.area_over_steps)},
          {"area_over_seconds", JsonOf(curve.area_over_seconds)}};
}

PageJson PairJson(const eval::AgentPair& pair) {
  return {{"first", pair.first},
          {"second", pair.second},
          {"difference", JsonOf(pair.test.difference)},
          {"p", pair.corrected_p_value},
          {"training_p", JsonOf(pair.corrected_training_p_value)},
          {"verdict", eval::ToString(pair.verdict)},
          {"improvement", JsonOf(pair.improvement)}};
}

PageJson ScoreJson(const ScoreContent& score, const ScoreResults& results) {
  PageJson json = {{"name", score.name},
                   {"label", score.label},
                   {"courses", score.courses},
                   {"protocol", score.protocol},
                   {"overlap", score.overlap},
                   {"best_row", score.best_row},
                   {"rows", PageJson::array()},
                   {"curves", PageJson::array()},
                   {"profiles", PageJson::array()},
                   {"pairs", PageJson::array()},
                   {"pairs_note", score.pairs.note}};
  for (const RowFigures& row : score.rows) json["rows"].push_back(RowJson(row, results.rows));
  for (const LearningCurve& curve : score.curves) json["curves"].push_back(CurveJson(curve));
  for (const Profile& profile : score.profiles) {
    PageJson shares = PageJson::array();
    for (const eval::Estimate& share : profile.shares) {
      shares.push_back(JsonOf(share));
    }
    json["profiles"].push_back({{"row", profile.row}, {"shares", std::move(shares)}});
  }
  for (const eval::AgentPair& pair : score.pairs.pairs) json["pairs"].push_back(PairJson(pair));
  return json;
}

PageJson FailuresJson(const ReportContent& content) {
  PageJson failures = PageJson::array();
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

/// The data that the page shows, as `eval::JsonForPage`.
std::string SweepPageData(const ReportContent& content) {
  PageJson data = {{"title", content.title},
                   {"progress", ProgressText(content.results)},
                   {"provenance", content.provenance},
                   {"warnings", content.warnings},
                   {"axes", content.cells.axis_names},
                   {"rows", PageJson::array()},
                   {"scores", PageJson::array()},
                   {"thresholds", ProfileThresholds()},
                   {"failures", FailuresJson(content)},
                   {"missing", PageJson::array()}};
  for (const Row& row : content.results.rows) {
    data["rows"].push_back({{"name", row.name},
                            {"title", row.title},
                            {"labels", row.labels},
                            {"is_planner", row.is_planner}});
  }
  for (std::size_t s = 0; s < content.scores.size(); ++s) {
    data["scores"].push_back(ScoreJson(content.scores[s], content.results.scores[s]));
  }
  for (const MissingScore& missing : content.results.missing) {
    data["missing"].push_back(Describe(missing, content.cells));
  }
  return eval::JsonForPage(data);
}

}  // namespace

std::string SweepPage(const ReportContent& content) {
  return eval::FillPage(kSweepPage, SweepPageData(content));
}

}  // namespace slalom::sweep
