#include "eval/report/physics_table.h"

#include <fmt/format.h>

#include <array>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

#include "base/check.h"
#include "eval/report/comparison.h"
#include "eval/report/paired_comparison.h"
#include "eval/report/table_text.h"

namespace slalom::eval {
namespace {

using OrderedJson = nlohmann::ordered_json;

using Difference = EstimateColumn<PairedComparison>;

constexpr std::array<Difference, 5> kDifferences = {{
    {"success [points]", "success_rate", 100.0, 1, true,
     [](const PairedComparison& p) -> std::optional<Estimate> { return p.success_rate; }},
    {"collision [points]", "collision_rate", 100.0, 1, true,
     [](const PairedComparison& p) -> std::optional<Estimate> { return p.collision_rate; }},
    {"timeout [points]", "timeout_rate", 100.0, 1, true,
     [](const PairedComparison& p) -> std::optional<Estimate> { return p.timeout_rate; }},
    {"traversal [s]", "traversal_time_s", 1.0, 2, true,
     [](const PairedComparison& p) { return p.traversal_time; }},
    {"BARN score", "barn_score", 1.0, 3, true,
     [](const PairedComparison& p) -> std::optional<Estimate> { return p.barn_score; }},
}};

std::string PhysicsText(const Result& result) {
  return result.physics_version.empty() ? result.physics
                                        : result.physics + " " + result.physics_version;
}

}  // namespace

Result ResultOf(const Evaluation& evaluation, const Provenance& provenance) {
  Result result = ParseResult(JsonReport(evaluation, provenance), "this evaluation").result;
  result.course_set_data = evaluation.task.courses;
  return result;
}

std::string PhysicsTable(std::span<const Result> results) {
  SLALOM_CHECK(!results.empty());
  std::string text = MarkdownComparison(results);
  auto out = std::back_inserter(text);
  std::string versions;
  for (const Result& result : results) {
    versions += (versions.empty() ? "" : ", ") + PhysicsText(result);
  }
  fmt::format_to(out, "\nPhysics: {}.\n", EscapeMarkdown(versions));
  const std::string reference = EscapeMarkdown(results.front().physics);
  if (results.size() == 1) return text;
  MarkdownTable table{.titles = {"physics"}};
  for (const Difference& column : kDifferences) table.titles.emplace_back(column.title);
  for (const Result& result : results.subspan(1)) {
    const PairedComparison pair = CompareInPairs(result, results.front());
    auto& row = table.rows.emplace_back();
    row.push_back(EscapeMarkdown(result.physics) + " minus " + reference);
    for (const Difference& column : kDifferences) row.push_back(CellText(column, pair));
  }
  fmt::format_to(out,
                 "\nDifferences to {} in the same episodes, course by course, with 95 % "
                 "intervals:\n\n{}",
                 reference, table.Print());
  return text;
}

std::string PhysicsJson(std::span<const Result> results, std::span<const std::string> reports) {
  SLALOM_CHECK(!results.empty());
  SLALOM_CHECK_EQ(results.size(), reports.size());
  OrderedJson object;
  object["evaluations"] = OrderedJson::array();
  for (const std::string& report : reports) {
    object["evaluations"].push_back(OrderedJson::parse(report));
  }
  object["differences"] = OrderedJson::array();
  for (const Result& result : results.subspan(1)) {
    const PairedComparison pair = CompareInPairs(result, results.front());
    OrderedJson difference = {{"physics", result.physics}, {"minus", results.front().physics}};
    for (const Difference& column : kDifferences) {
      const std::optional<Estimate> value = column.estimate(pair);
      const std::string key(column.key);
      difference[key] = value ? OrderedJson(value->value) : OrderedJson(nullptr);
      difference[key + "_interval"] =
          value && value->interval ? OrderedJson({value->interval->low, value->interval->high})
                                   : OrderedJson(nullptr);
    }
    object["differences"].push_back(std::move(difference));
  }
  return object.dump(2) + "\n";
}

}  // namespace slalom::eval
