#include <fmt/format.h>

#include <iterator>

#include "eval/comparison/printers.h"
#include "eval/csv_field.h"

namespace slalom::eval {
namespace {

std::string Field(const std::optional<double>& number) {
  return number ? fmt::format("{:.6f}", *number) : "";
}

}  // namespace

std::string FiguresCsvHead() {
  std::string text = "seeds,planned_seeds,courses,episodes";
  for (const Quantity& quantity : Quantities()) {
    fmt::format_to(std::back_inserter(text), ",{0},{0}_low,{0}_high,{0}_seed_mean,{0}_deviation",
                   quantity.key);
  }
  return text;
}

std::string FiguresCsvFields(const AgentFigures& agent) {
  std::string text = fmt::format("{},{},{},{}", agent.num_seeds, agent.num_planned,
                                 agent.num_courses, agent.num_episodes);
  for (const QuantityFigures& figures : agent.quantities) {
    text += "," + CsvEstimate(figures.estimate) + "," + Field(figures.seed_mean()) + "," +
            Field(figures.seed_deviation());
  }
  return text;
}

std::string FiguresCsv(std::span<const Group> groups) {
  std::string text = "course_set,agent,is_trained," + FiguresCsvHead() + ",files\n";
  for (const Group& group : groups) {
    for (const AgentFigures& agent : group.agents) {
      std::string files;
      for (const std::string& file : agent.files) files += (files.empty() ? "" : " ") + file;
      fmt::format_to(std::back_inserter(text), "{},{},{},{},{}\n", CsvField(group.title),
                     CsvField(agent.label), agent.is_trained, FiguresCsvFields(agent),
                     CsvField(files));
    }
  }
  return text;
}

std::string PairsCsv(std::span<const Group> groups) {
  std::string text = "course_set,first,second";
  const auto out = std::back_inserter(text);
  for (const Quantity& quantity : Quantities()) {
    if (quantity.aggregate != Aggregate::kMean) continue;
    fmt::format_to(out, ",{0}_difference,{0}_difference_low,{0}_difference_high", quantity.key);
  }
  text +=
      ",probability_of_improvement,probability_of_improvement_low,probability_of_improvement_high,"
      "p_value,p_value_holm,training_p_value,training_p_value_holm,verdict,same_starts\n";
  for (const Group& group : groups) {
    for (const AgentPair& pair : group.pairs) {
      fmt::format_to(out, "{},{},{}", CsvField(group.title),
                     CsvField(group.agents[pair.first].label),
                     CsvField(group.agents[pair.second].label));
      for (std::size_t q = 0; q < Quantities().size(); ++q) {
        if (Quantities()[q].aggregate != Aggregate::kMean) continue;
        text += "," + CsvEstimate(pair.differences[q]);
      }
      fmt::format_to(out, ",{},{:.6f},{:.6f},{},{},{},{}\n", CsvEstimate(pair.improvement),
                     pair.test.p_value, pair.corrected_p_value, Field(pair.test.training_p_value),
                     Field(pair.corrected_training_p_value), ToString(pair.verdict),
                     pair.same_starts);
    }
  }
  return text;
}

}  // namespace slalom::eval
