#include "app/watch/run_page.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "eval/report/embedded_page.h"

namespace slalom::watch {

extern const std::string_view kRunPage;  // An embedded page.

namespace {

using Json = nlohmann::json;

Json Number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

/// The columns in which anything stands.
Json ColumnsJson(const run::MetricsTable& table) {
  Json json = Json::object();
  for (std::size_t c = 0; c < table.names.size(); ++c) {
    Json values = Json::array();
    bool is_known = false;
    for (const double value : table.columns[c]) {
      values.push_back(Number(value));
      is_known = is_known || std::isfinite(value);
    }
    if (is_known) json[table.names[c]] = std::move(values);
  }
  return json;
}

}  // namespace

Json SummaryJson(const RunProgress& run) {
  return {{"name", run.name},
          {"state", std::string(ToString(run.state))},
          {"stage", run.stage},
          {"age_s", run.age_s},
          {"left_s", run.left_s ? Number(*run.left_s) : Json(nullptr)},
          {"training_s", Number(run.metrics.Last("training_s"))},
          {"steps", Number(run.metrics.Last("steps"))},
          {"success_rate", Number(run.metrics.Last("success_rate"))}};
}

Json RunJson(const RunProgress& run, const RunFacts& facts) {
  Json json = SummaryJson(run);
  json["facts"] = facts.lines;
  json["changes"] = facts.changes;
  json["curves"] = ColumnsJson(run.metrics);
  json["scores"] = ColumnsJson(run.scores);
  return json;
}

std::string LivePage() { return eval::FillPage(kRunPage, "null"); }

std::string RunPage(const std::filesystem::path& directory, const RunFacts& facts) {
  const auto run = ReadRun(directory, facts, kMaxPoints);
  base::ThrowIf(!run, "{}: there is no run here", directory.string());
  Json json = RunJson(*run, facts);
  json.erase("state");  // True for this moment only.
  json["left_s"] = nullptr;
  return eval::FillPage(kRunPage, eval::JsonForPage(json));
}

}  // namespace slalom::watch
