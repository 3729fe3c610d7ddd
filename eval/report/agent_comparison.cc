#include "eval/report/agent_comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

#include "base/check.h"
#include "base/error.h"
#include "eval/csv_field.h"
#include "eval/report/embedded_page.h"
#include "eval/report/table_text.h"

namespace slalom::eval {

extern const std::string_view kComparisonPage;  // An embedded page.

namespace {

[[noreturn]] void Refuse(const Result& first, const Result& other, const std::string& difference) {
  throw base::Error(
      fmt::format("{} and {} cannot be compared: {}", first.file, other.file, difference));
}

std::string CourseText(const Result& result) {
  return fmt::format("on the {} course{} of {}", result.courses.size(),
                     result.courses.size() == 1 ? "" : "s",
                     GroupByCourses(std::span(&result, 1)).front().title);
}

void RequireSameCourses(const Result& first, const Result& other) {
  if (HaveSameCourses(first, other)) return;
  const std::string left = CourseText(first);
  const std::string right = CourseText(other);
  Refuse(first, other,
         left == right ? fmt::format("both were driven {}, but some of these courses differ", left)
                       : fmt::format("the first was driven {} and the second {}", left, right));
}

void RequireSameEpisodes(const Result& first, const Result& other) {
  for (std::size_t c = 0; c < first.courses.size(); ++c) {
    const std::size_t num_first = first.courses[c].episodes.size();
    const std::size_t num_other = other.courses[c].episodes.size();
    if (num_first == num_other) continue;
    Refuse(
        first, other,
        fmt::format("course {} has {} episode{} in the first and {} in the second; evaluate both "
                    "with the same --episodes",
                    first.courses[c].name, num_first, num_first == 1 ? "" : "s", num_other));
  }
  if (first.seed != other.seed) {
    Refuse(
        first, other,
        fmt::format("the seed of the evaluation is {} in the first and {} in the second, so that "
                    "their episodes start at different places; evaluate both with the same --seed",
                    first.seed, other.seed));
  }
}

/// A table of `value` of each result's courses.
template <class Value>
ScoreTable MakeTable(std::span<const Result> results, const AgentResults& agent, Interval limits,
                     Value value) {
  ScoreTable table{agent.label, {}, limits, results[agent.results.front()].is_trained()};
  for (const std::size_t r : agent.results) {
    auto& row = table.scores.emplace_back();
    for (const ResultCourse& course : results[r].courses) row.push_back(value(course));
  }
  return table;
}

std::optional<Estimate> TraversalTime(std::span<const Result> results, const AgentResults& agent,
                                      const BootstrapOptions& options) {
  const auto sum_over_successes = [](const ResultCourse& course, auto of_episode) {
    double sum = 0.0;
    for (const ResultEpisode& episode : course.episodes) {
      if (episode.outcome == env::Outcome::kSuccess) sum += of_episode(episode);
    }
    return sum;
  };
  const Interval any{0.0, std::numeric_limits<double>::infinity()};
  const ScoreTable times = MakeTable(results, agent, any, [&](const ResultCourse& course) {
    return sum_over_successes(course, [](const ResultEpisode& episode) { return episode.time; });
  });
  const ScoreTable counts = MakeTable(results, agent, any, [&](const ResultCourse& course) {
    return sum_over_successes(course, [](const ResultEpisode&) { return 1.0; });
  });
  return BootstrapRatio({times, counts}, options);
}

AgentFigures FiguresOf(std::span<const Result> results, const AgentResults& agent,
                       std::span<const double> thresholds, const BootstrapOptions& options) {
  const ScoreTable successes = OutcomeTable(results, agent, env::Outcome::kSuccess);
  AgentFigures figures;
  figures.label = agent.label;
  figures.num_seeds = static_cast<int>(agent.results.size());
  for (std::size_t s = 0; s < agent.results.size(); ++s) {
    figures.files.push_back(results[agent.results[s]].file);
    figures.seed_success.push_back(Mean({agent.label, {successes.scores[s]}, successes.limits}));
  }
  figures.success_rate = BootstrapMean(successes, options);
  figures.interquartile_success = BootstrapInterquartileMean(successes, options);
  figures.collision_rate =
      BootstrapMean(OutcomeTable(results, agent, env::Outcome::kCollision), options);
  figures.traversal_time = TraversalTime(results, agent, options);
  figures.profile = BootstrapProfile(successes, thresholds, options);
  return figures;
}

void AddToList(const std::string& item, std::string& list) {
  list += (list.empty() ? "" : ", ") + item;
}

/// The agent, and in brackets its figures without an interval. Empty if all have one.
std::string WithoutInterval(const AgentFigures& agent) {
  std::string names;
  if (!agent.success_rate.interval) AddToList("success", names);
  if (!agent.interquartile_success.interval) AddToList("IQM", names);
  if (!agent.collision_rate.interval) AddToList("collision", names);
  return names.empty() ? "" : fmt::format("{} ({})", agent.label, names);
}

/// `scores`: a table of each agent, which says whether it was trained.
std::vector<std::string> NotesFor(const AgentComparison& comparison,
                                  std::span<const ScoreTable> scores) {
  std::vector<std::string> notes;
  if (comparison.num_courses == 1) {
    notes.push_back(
        "There is one course only, so there are no intervals, and p is 1: one course tells nothing "
        "of others.");
  }
  std::string single;
  std::string alike;
  for (std::size_t a = 0; a < comparison.agents.size(); ++a) {
    const AgentFigures& agent = comparison.agents[a];
    if (agent.num_seeds == 1 && scores[a].trained) AddToList(agent.label, single);
    const std::string without = WithoutInterval(agent);
    if (!without.empty()) AddToList(without, alike);
  }
  if (!single.empty()) {
    notes.push_back(fmt::format(
        "One seed: {}. Their intervals hold for these policies on other courses of the kind. They "
        "do not cover the noise of training: another training may do better or worse.",
        single));
  }
  if (!alike.empty() && comparison.num_courses > 1) {
    notes.push_back(
        fmt::format("No interval: {}. These scores are alike, so resampling them shows no spread. "
                    "That does not mean there is none.",
                    alike));
  }
  return notes;
}

}  // namespace

void RequireComparable(std::span<const Result> results) {
  RequireSameProtocol(results);
  for (const Result& result : results) {
    for (const ResultCourse& course : result.courses) {
      if (!course.episodes.empty()) continue;
      throw base::Error(fmt::format("{}: course {} has no episodes, expected at least one",
                                    result.file, course.name));
    }
    RequireSameCourses(results.front(), result);
    RequireSameEpisodes(results.front(), result);
  }
}

ScoreTable OutcomeTable(std::span<const Result> results, const AgentResults& agent,
                        env::Outcome outcome) {
  return MakeTable(results, agent, {0.0, 1.0}, [&](const ResultCourse& course) {
    const auto hits = std::ranges::count(course.episodes, outcome, &ResultEpisode::outcome);
    return static_cast<double>(hits) / static_cast<double>(course.episodes.size());
  });
}

AgentPair ComparePair(std::size_t first_index, const ScoreTable& first, std::size_t second_index,
                      const ScoreTable& second, const BootstrapOptions& bootstrap,
                      const PermutationOptions& permutation) {
  AgentPair pair;
  pair.first = first_index;
  pair.second = second_index;
  pair.test = ComparePaired(first, second, bootstrap, permutation);
  pair.improvement = BootstrapProbabilityOfImprovement(first, second, bootstrap);
  return pair;
}

void CorrectPValues(std::span<AgentPair> pairs) {
  std::vector<double> of_policies;
  std::vector<double> of_trainings;
  for (const AgentPair& pair : pairs) {
    of_policies.push_back(pair.test.p_value);
    if (pair.test.training_p_value) of_trainings.push_back(*pair.test.training_p_value);
  }
  const std::vector<double> policies = HolmCorrection(of_policies);
  const std::vector<double> trainings = HolmCorrection(of_trainings);
  std::size_t t = 0;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    AgentPair& pair = pairs[k];
    pair.corrected_p_value = policies[k];
    if (pair.test.training_p_value) pair.corrected_training_p_value = trainings[t++];
    pair.verdict = VerdictOf(pair.test, pair.corrected_p_value, pair.corrected_training_p_value,
                             trainings.size());
  }
}

AgentComparison CompareAgents(std::span<const Result> results, std::span<const AgentResults> agents,
                              const BootstrapOptions& bootstrap,
                              const PermutationOptions& permutation) {
  SLALOM_CHECK(!agents.empty());
  const Result& first_result = results[agents.front().results.front()];
  AgentComparison comparison;
  comparison.title = GroupByCourses(std::span(&first_result, 1)).front().title;
  comparison.protocol = ProtocolSentence(first_result);
  comparison.num_courses = static_cast<int>(first_result.courses.size());
  // Nothing lies above 1.
  for (int k = 0; k < 20; ++k) comparison.thresholds.push_back(k / 20.0);
  std::vector<ScoreTable> successes;
  for (const AgentResults& agent : agents) {
    comparison.agents.push_back(FiguresOf(results, agent, comparison.thresholds, bootstrap));
    successes.push_back(OutcomeTable(results, agent, env::Outcome::kSuccess));
  }
  for (std::size_t i = 0; i < agents.size(); ++i) {
    for (std::size_t j = i + 1; j < agents.size(); ++j) {
      comparison.pairs.push_back(
          ComparePair(i, successes[i], j, successes[j], bootstrap, permutation));
    }
  }
  CorrectPValues(comparison.pairs);
  comparison.settings = FindSettingDifferences(results, agents);
  comparison.notes = NotesFor(comparison, successes);
  for (const AgentResults& agent : agents) {
    for (const std::size_t r : agent.results) {
      const std::string overlap = OverlapSentence(results[r], agent.label);
      if (overlap.empty()) continue;
      comparison.notes.push_back("Trained on its test: " + overlap);
      break;
    }
  }
  return comparison;
}

namespace {

constexpr std::array<EstimateColumn<AgentFigures>, 4> kAgentColumns = {{
    {"success [%]", "success_rate", 100.0, 1, false,
     [](const AgentFigures& a) -> std::optional<Estimate> { return a.success_rate; }},
    {"success, IQM [%]", "success_rate_iqm", 100.0, 1, false,
     [](const AgentFigures& a) -> std::optional<Estimate> { return a.interquartile_success; }},
    {"collision [%]", "collision_rate", 100.0, 1, false,
     [](const AgentFigures& a) -> std::optional<Estimate> { return a.collision_rate; }},
    {"traversal [s]", "traversal_time_s", 1.0, 1, false,
     [](const AgentFigures& a) { return a.traversal_time; }},
}};

constexpr std::array<EstimateColumn<AgentPair>, 2> kPairColumns = {{
    {"difference [points]", "success_rate_difference", 100.0, 1, true,
     [](const AgentPair& p) -> std::optional<Estimate> { return p.test.difference; }},
    {"first better [%]", "probability_of_improvement", 100.0, 1, false,
     [](const AgentPair& p) -> std::optional<Estimate> { return p.improvement; }},
}};

/// A p-value of a pair.
struct PColumn {
  std::string_view title;
  std::string_view key;  // Head of the CSV's column.
  std::optional<double> (*p)(const AgentPair& pair);
};

constexpr std::array<PColumn, 4> kPColumns = {{
    {"p of these policies", "p_value",
     [](const AgentPair& p) -> std::optional<double> { return p.test.p_value; }},
    {"corrected", "p_value_holm",
     [](const AgentPair& p) -> std::optional<double> { return p.corrected_p_value; }},
    {"p of the trainings", "training_p_value",
     [](const AgentPair& p) { return p.test.training_p_value; }},
    {"corrected", "training_p_value_holm",
     [](const AgentPair& p) { return p.corrected_training_p_value; }},
}};

/// Explanation of the columns, below the tables.
constexpr std::string_view kLegend =
    "In brackets 95 % bootstrap intervals over courses and, where an agent has several, seeds. IQM "
    "is the interquartile mean. The difference is of success, the first agent minus the second. "
    "First better is the chance that a policy of the first scores higher on a course; draws "
    "count half. p of these policies is that of flipping signs of the courses' differences, and p "
    "of the trainings that of relabelling the seeds. Corrected is after Holm, for the number "
    "of pairs.";

MarkdownTable AgentTable(const AgentComparison& comparison) {
  MarkdownTable table{.titles = {"agent", "seeds"}};
  for (const auto& column : kAgentColumns) table.titles.emplace_back(column.title);
  for (const AgentFigures& agent : comparison.agents) {
    auto& row = table.rows.emplace_back();
    row = {EscapeMarkdown(agent.label), std::to_string(agent.num_seeds)};
    for (const auto& column : kAgentColumns) row.push_back(CellText(column, agent));
  }
  return table;
}

MarkdownTable PairTable(const AgentComparison& comparison) {
  MarkdownTable table{.titles = {"first", "second"}, .num_names = 2};
  for (const auto& column : kPairColumns) table.titles.emplace_back(column.title);
  for (const PColumn& column : kPColumns) table.titles.emplace_back(column.title);
  for (const AgentPair& pair : comparison.pairs) {
    auto& row = table.rows.emplace_back();
    row = {EscapeMarkdown(comparison.agents[pair.first].label),
           EscapeMarkdown(comparison.agents[pair.second].label)};
    for (const auto& column : kPairColumns) row.push_back(CellText(column, pair));
    for (const PColumn& column : kPColumns) row.push_back(PValueText(column.p(pair)));
  }
  return table;
}

std::string CsvLine(const std::string& agent, const std::string& against, std::string_view quantity,
                    const std::optional<double>& threshold,
                    const std::optional<Estimate>& estimate) {
  return fmt::format("{},{},{},{},{}\n", CsvField(agent), CsvField(against), quantity,
                     threshold ? fmt::format("{:.6f}", *threshold) : "", CsvEstimate(estimate));
}

nlohmann::json AgentJson(const AgentFigures& agent) {
  nlohmann::json profile = nlohmann::json::array();
  for (const Estimate& share : agent.profile) profile.push_back(JsonOf(share));
  return {{"label", agent.label},
          {"files", agent.files},
          {"seed_success", agent.seed_success},
          {"success_rate", JsonOf(agent.success_rate)},
          {"success_rate_iqm", JsonOf(agent.interquartile_success)},
          {"collision_rate", JsonOf(agent.collision_rate)},
          {"traversal_time_s", JsonOf(agent.traversal_time)},
          {"profile", std::move(profile)}};
}

nlohmann::json PairJson(const AgentPair& pair) {
  return {{"first", pair.first},
          {"second", pair.second},
          {"difference", JsonOf(pair.test.difference)},
          {"improvement", JsonOf(pair.improvement)},
          {"p", pair.test.p_value},
          {"p_holm", pair.corrected_p_value},
          {"training_p", JsonOf(pair.test.training_p_value)},
          {"training_p_holm", JsonOf(pair.corrected_training_p_value)}};
}

}  // namespace

std::string MarkdownOf(const AgentComparison& comparison) {
  std::string text =
      fmt::format("# Agents on {}\n\n{} course{}. {}\n\n{}", EscapeMarkdown(comparison.title),
                  comparison.num_courses, comparison.num_courses == 1 ? "" : "s",
                  EscapeMarkdown(comparison.protocol), AgentTable(comparison).Print());
  if (!comparison.pairs.empty()) text += fmt::format("\n{}", PairTable(comparison).Print());
  text += fmt::format("\n{}\n", kLegend);
  for (const std::string& note : comparison.notes)
    text += fmt::format("\n{}\n", EscapeMarkdown(note));
  return text + MarkdownOf(comparison.settings, 2);
}

std::string CsvOf(const AgentComparison& comparison) {
  std::string text = "agent,against,quantity,threshold,value,low,high\n";
  for (const AgentFigures& agent : comparison.agents) {
    text += CsvLine(agent.label, "", "seeds", {}, Estimate{double(agent.num_seeds), {}});
    for (const auto& column : kAgentColumns) {
      text += CsvLine(agent.label, "", column.key, {}, column.estimate(agent));
    }
    for (std::size_t t = 0; t < agent.profile.size(); ++t) {
      text += CsvLine(agent.label, "", "share_of_success_rates_above", comparison.thresholds[t],
                      agent.profile[t]);
    }
  }
  for (const AgentPair& pair : comparison.pairs) {
    const auto add = [&](std::string_view quantity, const std::optional<Estimate>& estimate) {
      text += CsvLine(comparison.agents[pair.first].label, comparison.agents[pair.second].label,
                      quantity, {}, estimate);
    };
    for (const auto& column : kPairColumns) add(column.key, column.estimate(pair));
    for (const PColumn& column : kPColumns) {
      const std::optional<double> p = column.p(pair);
      add(column.key, p ? std::optional(Estimate{*p, std::nullopt}) : std::nullopt);
    }
  }
  return text;
}

std::string ComparisonPageData(const AgentComparison& comparison) {
  nlohmann::json data = {{"title", comparison.title},
                         {"protocol", comparison.protocol},
                         {"num_courses", comparison.num_courses},
                         {"thresholds", comparison.thresholds},
                         {"notes", comparison.notes},
                         {"settings", JsonOf(comparison.settings)},
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
