#include <cmath>
#include <nlohmann/json.hpp>

#include "eval/comparison/printers.h"
#include "eval/report/embedded_page.h"

namespace slalom::eval {

using Json = nlohmann::json;

Json QuantitiesJson() {
  Json list = Json::array();
  for (const Quantity& quantity : Quantities()) {
    list.push_back({{"key", quantity.key},
                    {"title", quantity.title},
                    {"unit", quantity.unit},
                    {"difference_unit", quantity.difference_unit()},
                    {"factor", quantity.factor},
                    {"digits", quantity.digits},
                    {"higher_is_better", quantity.higher_is_better},
                    {"limit", std::isfinite(quantity.limit) ? Json(quantity.limit) : Json()}});
  }
  return list;
}

Json JsonOf(const AgentFigures& agent) {
  Json figures = Json::object();
  for (std::size_t q = 0; q < agent.quantities.size(); ++q) {
    const QuantityFigures& of_quantity = agent.quantities[q];
    figures[std::string(Quantities()[q].key)] = {
        {"estimate", JsonOf(of_quantity.estimate)},
        {"mean", JsonOf(of_quantity.seed_mean())},
        {"deviation", JsonOf(of_quantity.seed_deviation())},
        {"seeds", of_quantity.seeds}};
  }
  Json profile = Json::array();
  for (const Estimate& share : agent.profile) profile.push_back(JsonOf(share));
  Json json = {{"label", agent.label},         {"is_trained", agent.is_trained},
               {"seeds", agent.num_seeds},     {"planned", agent.num_planned},
               {"courses", agent.num_courses}, {"episodes", agent.num_episodes},
               {"files", agent.files},         {"figures", std::move(figures)},
               {"profile", std::move(profile)}};
  if (agent.training) {
    json.update({{"steps", JsonOf(agent.training->steps)},
                 {"updates", JsonOf(agent.training->updates)},
                 {"imagined", JsonOf(agent.training->imagined)},
                 {"training_s", JsonOf(agent.training->training_s)}});
  }
  for (const PublishedNumber& number : agent.published) {
    json["published"][std::string(Quantities()[number.quantity].key)].push_back(
        {{"source", number.source},
         {"value", number.value},
         {"deviation", JsonOf(number.deviation)}});
  }
  return json;
}

Json JsonOf(const AgentPair& pair) {
  Json differences = Json::object();
  for (std::size_t q = 0; q < pair.differences.size(); ++q) {
    if (!pair.differences[q]) continue;
    differences[std::string(Quantities()[q].key)] = JsonOf(pair.differences[q]);
  }
  return {{"first", pair.first},
          {"second", pair.second},
          {"differences", std::move(differences)},
          {"improvement", JsonOf(pair.improvement)},
          {"p", pair.test.p_value},
          {"p_corrected", pair.corrected_p_value},
          {"training_p", JsonOf(pair.test.training_p_value)},
          {"training_p_corrected", JsonOf(pair.corrected_training_p_value)},
          {"verdict", ToString(pair.verdict)},
          {"same_starts", pair.same_starts}};
}

Json JsonOf(const Group& group) {
  Json json = {{"title", group.title},
               {"protocol", group.protocol},
               {"num_courses", group.num_courses},
               {"columns", Json::array()},
               {"agents", Json::array()},
               {"pairs", Json::array()},
               {"notes", group.notes},
               {"drawn", JsonOf(group.drawn)},
               {"settings", JsonOf(group.settings)}};
  for (const std::size_t q : group.columns) json["columns"].push_back(Quantities()[q].key);
  for (const AgentFigures& agent : group.agents) json["agents"].push_back(JsonOf(agent));
  for (const AgentPair& pair : group.pairs) json["pairs"].push_back(JsonOf(pair));
  return json;
}

}  // namespace slalom::eval
