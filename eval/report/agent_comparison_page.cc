#include "eval/report/agent_comparison_page.h"

#include <nlohmann/json.hpp>
#include <optional>

#include "eval/report/embedded_page.h"

namespace slalom::eval {

extern const std::string_view kComparisonPage;  // An embedded page.

namespace {

/// [value, low, high]; null where there is none.
nlohmann::json Triple(const std::optional<Estimate>& estimate) {
  if (!estimate) return nullptr;
  if (!estimate->interval) return {estimate->value, nullptr, nullptr};
  return {estimate->value, estimate->interval->low, estimate->interval->high};
}

nlohmann::json NumberOrNull(const std::optional<double>& number) {
  return number ? nlohmann::json(*number) : nlohmann::json(nullptr);
}

nlohmann::json AgentJson(const AgentFigures& agent) {
  nlohmann::json profile = nlohmann::json::array();
  for (const Estimate& share : agent.profile) profile.push_back(Triple(share));
  return {{"label", agent.label},
          {"files", agent.files},
          {"seed_success", agent.seed_success},
          {"success_rate", Triple(agent.success_rate)},
          {"success_rate_iqm", Triple(agent.interquartile_success)},
          {"collision_rate", Triple(agent.collision_rate)},
          {"traversal_time_s", Triple(agent.traversal_time)},
          {"profile", std::move(profile)}};
}

nlohmann::json PairJson(const AgentPair& pair) {
  return {{"first", pair.first},
          {"second", pair.second},
          {"difference", Triple(pair.test.difference)},
          {"improvement", Triple(pair.improvement)},
          {"p", pair.test.p_value},
          {"p_holm", pair.corrected_p_value},
          {"training_p", NumberOrNull(pair.test.training_p_value)},
          {"training_p_holm", NumberOrNull(pair.corrected_training_p_value)}};
}

}  // namespace

std::string ComparisonPageData(const AgentComparison& comparison) {
  nlohmann::json data = {{"title", comparison.title},
                         {"protocol", comparison.protocol},
                         {"num_courses", comparison.num_courses},
                         {"thresholds", comparison.thresholds},
                         {"notes", comparison.notes},
                         {"agents", nlohmann::json::array()},
                         {"pairs", nlohmann::json::array()}};
  for (const AgentFigures& agent : comparison.agents) data["agents"].push_back(AgentJson(agent));
  for (const AgentPair& pair : comparison.pairs) data["pairs"].push_back(PairJson(pair));
  return JsonForPage(data);
}

std::string ComparisonPage(const AgentComparison& comparison) {
  return FillPage(kComparisonPage, ComparisonPageData(comparison));
}

}  // namespace slalom::eval
