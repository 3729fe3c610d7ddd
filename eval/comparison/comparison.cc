#include "eval/comparison/comparison.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/json.h"
#include "eval/summary.h"

namespace slalom::eval {
namespace {

template <env::Outcome outcome>
std::optional<double> Has(const ResultEpisode& episode, double /*optimal_time*/) {
  return episode.outcome == outcome ? 1.0 : 0.0;
}

template <bool of_successes>
std::optional<double> Time(const ResultEpisode& episode, double /*optimal_time*/) {
  const bool is_success = episode.outcome == env::Outcome::kSuccess;
  return is_success == of_successes ? std::optional(episode.time) : std::nullopt;
}

std::optional<double> Touched(const ResultEpisode& episode, double /*optimal_time*/) {
  return episode.num_collisions > 0 ? 1.0 : 0.0;
}

std::optional<double> Score(const ResultEpisode& episode, double optimal_time) {
  return BarnScore(episode.outcome, episode.time, optimal_time);
}

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

constexpr std::array<Quantity, 9> kQuantities = {{
    {"success_rate", "success", "%", 100.0, 1, true, true, 1.0, Aggregate::kMean,
     Has<env::Outcome::kSuccess>},
    {"success_rate_iqm", "IQM", "%", 100.0, 1, true, true, 1.0, Aggregate::kInterquartileMean,
     Has<env::Outcome::kSuccess>},
    {"success_rate_worst", "worst 5 %", "%", 100.0, 1, true, true, 1.0,
     Aggregate::kLowestTwentiethMean, Has<env::Outcome::kSuccess>},
    {"collision_rate", "collision", "%", 100.0, 1, false, true, 1.0, Aggregate::kMean,
     Has<env::Outcome::kCollision>},
    {"timeout_rate", "timeout", "%", 100.0, 1, false, true, 1.0, Aggregate::kMean,
     Has<env::Outcome::kTimeout>},
    {"contact_rate", "touched", "%", 100.0, 1, false, true, 1.0, Aggregate::kMean, Touched},
    {"survival_time_s", "survival", "s", 1.0, 1, true, false, kNoLimit, Aggregate::kMean,
     Time<false>},
    {"traversal_time_s", "traversal", "s", 1.0, 1, false, false, kNoLimit, Aggregate::kMean,
     Time<true>},
    {"barn_score", "BARN score", "", 1.0, 3, true, false, 1.0 / kBarnLimit, Aggregate::kMean,
     Score},
}};

}  // namespace

std::span<const Quantity> Quantities() { return kQuantities; }

std::optional<std::size_t> FindQuantity(std::string_view key) {
  const auto found = std::ranges::find(kQuantities, key, &Quantity::key);
  if (found == kQuantities.end()) return std::nullopt;
  return static_cast<std::size_t>(found - kQuantities.begin());
}

namespace {

const Quantity& Success() { return Quantities().front(); }

double MeanOf(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

TrainingFigures MeanOf(const std::vector<TrainingFigures>& trainings) {
  TrainingFigures means;
  for (const auto number : {&TrainingFigures::steps, &TrainingFigures::updates,
                            &TrainingFigures::imagined, &TrainingFigures::training_s}) {
    std::vector<double> known;
    for (const TrainingFigures& training : trainings) {
      if (training.*number) known.push_back(*(training.*number));
    }
    if (!known.empty()) means.*number = MeanOf(known);
  }
  return means;
}

/// The highest value that an episode can have.
double LimitOf(const Result& result, const Quantity& quantity) {
  if (std::isfinite(quantity.limit)) return quantity.limit;
  const auto limit = result.protocol.find("time_limit_s");
  const nlohmann::json number =
      limit == result.protocol.end() ? nlohmann::json() : base::ParseJson(limit->second);
  return number.is_number() ? number.get<double>() : 1e6;
}

/// A quantity over the episodes on each course. Requires: at least one seed.
RatioTables TablesOf(const Agent& agent, const Quantity& quantity) {
  SLALOM_CHECK(!agent.seeds.empty());
  ScoreTable empty{
      agent.label, {}, {0.0, LimitOf(*agent.seeds.front(), quantity)}, agent.is_trained};
  RatioTables tables{empty, empty};
  for (const Result* seed : agent.seeds) {
    std::vector<double>& sums = tables.sums.scores.emplace_back();
    std::vector<double>& counts = tables.counts.scores.emplace_back();
    for (const ResultCourse& course : seed->courses) {
      sums.push_back(0.0);
      counts.push_back(0.0);
      for (const ResultEpisode& episode : course.episodes) {
        const auto value = quantity.value(episode, course.optimal_time);
        if (!value) continue;
        sums.back() += *value;
        counts.back() += 1.0;
      }
    }
  }
  return tables;
}

std::optional<double> ValueOf(const Agent& agent, const Quantity& quantity) {
  if (quantity.aggregate == Aggregate::kInterquartileMean) {
    return InterquartileMean(ScoresOf(agent, quantity));
  }
  if (quantity.aggregate == Aggregate::kLowestTwentiethMean) {
    return LowestTwentiethMean(ScoresOf(agent, quantity));
  }
  double sum = 0.0;
  double count = 0.0;
  const RatioTables tables = TablesOf(agent, quantity);
  for (std::size_t s = 0; s < tables.sums.num_seeds(); ++s) {
    for (const double of_course : tables.sums.scores[s]) sum += of_course;
    for (const double of_course : tables.counts.scores[s]) count += of_course;
  }
  return count > 0.0 ? std::optional(sum / count) : std::nullopt;
}

std::vector<std::size_t> DefaultColumns(std::span<const Agent> agents) {
  const auto has_seeds =
      std::ranges::find_if_not(agents, [](const Agent& agent) { return agent.seeds.empty(); });
  const bool ends = has_seeds == agents.end() || has_seeds->seeds.front()->collision_ends();
  const bool several =
      std::ranges::any_of(agents, [](const Agent& agent) { return agent.seeds.size() > 1; });
  std::vector<std::size_t> columns;
  for (std::size_t q = 0; q < Quantities().size(); ++q) {
    const Quantity& quantity = Quantities()[q];
    if (quantity.key == "contact_rate" && ends) continue;
    if (quantity.aggregate != Aggregate::kMean && !several) continue;
    columns.push_back(q);
  }
  return columns;
}

bool HaveSameStarts(const Agent& first, const Agent& second) {
  const Result& one = *first.seeds.front();
  return std::ranges::all_of(second.seeds, [&](const Result* other) {
    return one.seed == other->seed &&
           std::ranges::equal(
               one.courses, other->courses, {},
               [](const ResultCourse& course) { return course.episodes.size(); },
               [](const ResultCourse& course) { return course.episodes.size(); });
  });
}

AgentPair ComparePair(std::span<const Agent> agents, std::size_t first, std::size_t second,
                      const std::vector<std::size_t>& columns, const CompareOptions& options) {
  const Agent& a = agents[first];
  const Agent& b = agents[second];
  ScoreTable scores_a = ScoresOf(a, Success());
  ScoreTable scores_b = ScoresOf(b, Success());
  if (!a.policies.empty() && a.policies == b.policies) scores_a.trained = scores_b.trained = false;
  AgentPair pair;
  pair.first = first;
  pair.second = second;
  pair.test = ComparePaired(scores_a, scores_b, options.bootstrap, options.permutation);
  pair.improvement = BootstrapProbabilityOfImprovement(scores_a, scores_b, options.bootstrap);
  pair.same_starts = HaveSameStarts(a, b);
  pair.differences.resize(Quantities().size());
  for (const std::size_t q : columns) {
    const Quantity& quantity = Quantities()[q];
    if (quantity.aggregate != Aggregate::kMean || q == 0) continue;
    pair.differences[q] = DifferenceOf(a, b, quantity, options.bootstrap);
  }
  pair.differences.front() = pair.test.difference;
  return pair;
}

/// Corrects the p-values of all pairs for their number, and finds the verdicts.
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

/// Fills in the pairs of a group, and the notes on what is not among them.
void ComparePairs(std::span<const Agent> agents, const CompareOptions& options, Group& group) {
  std::vector<std::size_t> evaluated;
  for (std::size_t a = 0; a < agents.size(); ++a) {
    if (!agents[a].seeds.empty()) evaluated.push_back(a);
  }
  if (evaluated.size() > kMaxPairedAgents) {
    group.notes.push_back(fmt::format(
        "{} agents make too many pairs to compare each with each; `slalom report` compares those "
        "that you name, at most {}.",
        evaluated.size(), kMaxPairedAgents));
    return;
  }
  int num_different = 0;
  for (std::size_t i = 0; i < evaluated.size(); ++i) {
    for (std::size_t j = i + 1; j < evaluated.size(); ++j) {
      if (AreOnSameCourses(agents[evaluated[i]], agents[evaluated[j]])) {
        group.pairs.push_back(
            ComparePair(agents, evaluated[i], evaluated[j], group.columns, options));
      } else {
        ++num_different;
      }
    }
  }
  CorrectPValues(group.pairs);
  const bool is_one = num_different == 1;
  if (num_different > 0) {
    group.notes.push_back(fmt::format(
        "{} pair{} of agents {} left out, as {} evaluated on different courses or by different "
        "rules.",
        num_different, is_one ? "" : "s", is_one ? "is" : "are", is_one ? "it was" : "they were"));
  }
  if (!std::ranges::all_of(group.pairs, &AgentPair::same_starts)) {
    group.notes.push_back(
        "Not all agents drove from the same starts (--seed, --episodes), so their differences hold "
        "the luck of the starts, too.");
  }
}

/// The agent, and in brackets its figures without an interval. Empty if all have one.
std::string WithoutInterval(const AgentFigures& agent, const std::vector<std::size_t>& columns) {
  std::vector<std::string_view> titles;
  for (const std::size_t q : columns) {
    const std::optional<Estimate>& estimate = agent.quantities[q].estimate;
    if (estimate && !estimate->interval) titles.push_back(Quantities()[q].title);
  }
  return titles.empty() ? "" : fmt::format("{} ({})", agent.label, fmt::join(titles, ", "));
}

/// Adds the notes on what the intervals of the agents do not say.
void AddNotes(Group& group) {
  const bool has_one_course = group.num_courses == 1;
  if (has_one_course) {
    group.notes.push_back(
        "There is one course only, so intervals are those of further episodes on it, and p is 1: "
        "one course tells nothing of others.");
  }
  std::vector<std::string> single;
  std::vector<std::string> alike;
  for (const AgentFigures& agent : group.agents) {
    if (agent.num_seeds == 1 && agent.is_trained) single.push_back(agent.label);
    const std::string without = WithoutInterval(agent, group.columns);
    if (!without.empty()) alike.push_back(without);
  }
  if (!single.empty()) {
    group.notes.push_back(fmt::format(
        "One seed: {}. Their intervals hold for these policies on other courses of the kind. They "
        "do not cover the noise of training: another training may do better or worse.",
        fmt::join(single, ", ")));
  }
  if (!alike.empty() && !has_one_course) {
    group.notes.push_back(
        fmt::format("No interval: {}. These scores are alike, so resampling them shows no spread. "
                    "That does not mean there is none.",
                    fmt::join(alike, ", ")));
  }
}

[[noreturn]] void Refuse(const Result& first, const Result& other, const std::string& difference) {
  throw base::Error("{} and {} cannot be compared: {}", first.file, other.file, difference);
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

}  // namespace

std::optional<double> QuantityFigures::seed_mean() const {
  if (seeds.empty()) return std::nullopt;
  return MeanOf(seeds);
}

std::optional<double> QuantityFigures::seed_deviation() const {
  if (seeds.size() < 2) return std::nullopt;
  const double mean = MeanOf(seeds);
  double squares = 0.0;
  for (const double value : seeds) squares += (value - mean) * (value - mean);
  return std::sqrt(squares / static_cast<double>(seeds.size() - 1));
}

bool AreOnSameCourses(const Agent& first, const Agent& second) {
  return std::ranges::all_of(first.seeds, [&](const Result* one) {
    return std::ranges::all_of(second.seeds, [&](const Result* other) {
      return one->protocol == other->protocol && HaveSameCourses(*one, *other);
    });
  });
}

ScoreTable ScoresOf(const Agent& agent, const Quantity& quantity) {
  RatioTables tables = TablesOf(agent, quantity);
  for (std::size_t s = 0; s < tables.sums.num_seeds(); ++s) {
    for (std::size_t c = 0; c < tables.sums.num_courses(); ++c) {
      tables.sums.scores[s][c] /= std::max(1.0, tables.counts.scores[s][c]);
    }
  }
  return std::move(tables.sums);
}

std::optional<double> ValueOf(const Result& result, const Quantity& quantity) {
  return ValueOf(Agent{"", result.is_trained(), {&result}, 1, ""}, quantity);
}

std::vector<double> ProfileThresholds() {
  std::vector<double> thresholds;
  for (int k = 0; k <= 20; ++k) thresholds.push_back(k / 20.0);
  return thresholds;
}

std::optional<Estimate> EstimateOf(const Agent& agent, const Quantity& quantity,
                                   const BootstrapOptions& options) {
  if (agent.seeds.empty()) return std::nullopt;
  if (quantity.aggregate == Aggregate::kInterquartileMean) {
    return BootstrapInterquartileMean(ScoresOf(agent, quantity), options);
  }
  if (quantity.aggregate == Aggregate::kLowestTwentiethMean) {
    return BootstrapLowestTwentiethMean(ScoresOf(agent, quantity), options);
  }
  const RatioTables tables = TablesOf(agent, quantity);
  return quantity.is_rate ? BootstrapShare(tables, options) : BootstrapRatio(tables, options);
}

std::optional<Estimate> DifferenceOf(const Agent& first, const Agent& second,
                                     const Quantity& quantity, const BootstrapOptions& options) {
  SLALOM_CHECK(quantity.aggregate == Aggregate::kMean);
  if (first.seeds.empty() || second.seeds.empty()) return std::nullopt;
  return BootstrapRatioDifference(TablesOf(first, quantity), TablesOf(second, quantity),
                                  AreOnSameCourses(first, second), options);
}

AgentFigures FiguresOf(const Agent& agent, const BootstrapOptions& options) {
  AgentFigures figures;
  figures.label = agent.label;
  figures.is_trained = agent.is_trained;
  figures.num_seeds = static_cast<int>(agent.seeds.size());
  figures.num_planned = std::max(agent.num_planned, figures.num_seeds);
  if (agent.trainings) figures.training = MeanOf(*agent.trainings);
  figures.published = agent.published;
  for (const Result* seed : agent.seeds) {
    figures.num_courses = static_cast<int>(seed->courses.size());
    for (const ResultCourse& course : seed->courses) {
      figures.num_episodes += static_cast<int>(course.episodes.size());
    }
    figures.files.push_back(seed->file);
  }
  for (const Quantity& quantity : Quantities()) {
    QuantityFigures& of_quantity = figures.quantities.emplace_back();
    of_quantity.estimate = EstimateOf(agent, quantity, options);
    for (const Result* seed : agent.seeds) {
      if (const auto value = ValueOf(*seed, quantity)) of_quantity.seeds.push_back(*value);
    }
  }
  if (!agent.seeds.empty()) {
    figures.profile = BootstrapProfile(ScoresOf(agent, Success()), ProfileThresholds(), options);
  }
  return figures;
}

Group CompareAgents(std::span<const Agent> agents, const CompareOptions& options) {
  Group group;
  group.columns = options.columns.empty() ? DefaultColumns(agents) : options.columns;
  for (const Agent& agent : agents) {
    group.agents.push_back(FiguresOf(agent, options.bootstrap));
    if (agent.seeds.empty() || !group.protocol.empty()) continue;
    const Result& first = *agent.seeds.front();
    group.title = GroupByCourses(std::span(&first, 1)).front().title;
    group.protocol = ProtocolSentence(first);
    group.num_courses = static_cast<int>(first.courses.size());
  }
  ComparePairs(agents, options, group);
  AddNotes(group);
  return group;
}

Comparison CompareResults(std::span<const Result> results, std::vector<AgentResults> agents,
                          const CompareOptions& options) {
  Comparison comparison{results, std::move(agents), {}};
  for (const ResultGroup& courses : GroupByCourses(results)) {
    const std::vector<AgentResults> named = AgentsIn(courses, comparison.agents);
    std::vector<Agent> inside;
    for (const AgentResults& agent : named) {
      const Result& first = results[agent.results.front()];
      Agent& added = inside.emplace_back(Agent{agent.label, first.is_trained(), {}, 0, ""});
      for (const std::size_t r : agent.results) {
        added.seeds.push_back(&results[r]);
        added.policies += results[r].source + "\n";
      }
    }
    Group& group = comparison.groups.emplace_back(CompareAgents(inside, options));
    group.title = courses.title;
    for (const Agent& agent : inside) {
      const auto trained_on_it = std::ranges::find_if_not(agent.seeds, [&](const Result* seed) {
        return OverlapSentence(*seed, agent.label).empty();
      });
      if (trained_on_it == agent.seeds.end()) continue;
      group.notes.push_back("Trained on its test: " +
                            OverlapSentence(**trained_on_it, agent.label));
    }
    group.drawn = BinByDrawnFields(results, named);
    group.settings = FindSettingDifferences(results, named);
  }
  return comparison;
}

void RequireComparable(std::span<const Result> results) {
  RequireSameProtocol(results);
  for (const Result& result : results) {
    for (const ResultCourse& course : result.courses) {
      if (!course.episodes.empty()) continue;
      throw base::Error("{}: course {} has no episodes, expected at least one", result.file,
                        course.name);
    }
    RequireSameCourses(results.front(), result);
    RequireSameEpisodes(results.front(), result);
  }
}

}  // namespace slalom::eval
