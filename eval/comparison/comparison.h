#pragma once

#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "eval/report/drawn_bins.h"
#include "eval/report/result.h"
#include "eval/report/result_group.h"
#include "eval/report/setting_differences.h"
#include "eval/statistics/bootstrap.h"
#include "eval/statistics/permutation.h"
#include "eval/statistics/score_table.h"

/// Agents of one seed or several, compared on one list of courses. Every command that compares
/// agents does it here. docs/statistics.md says how the numbers are made and read.

namespace slalom::eval {

/// How the scores of an agent by seed and course become one number.
enum class Aggregate {
  kMean,                 ///< Over the episodes that have the quantity.
  kInterquartileMean,    ///< `InterquartileMean`
  kLowestTwentiethMean,  ///< `LowestTwentiethMean`
};

/// A quantity that is measured of an agent. All tables, files and pages show quantities of one
/// list, `Quantities`.
struct Quantity {
  std::string_view key;    ///< In files: "success_rate".
  std::string_view title;  ///< In tables, in lower case: "success".
  std::string_view unit;   ///< As shown: "%", "s" or empty.
  double factor = 1.0;     ///< From the quantity to the number that is shown.
  int digits = 1;          ///< Decimals that are shown.
  bool higher_is_better = true;
  bool is_rate = true;                                     ///< A share of episodes.
  double limit = std::numeric_limits<double>::infinity();  ///< No value lies above it.
  Aggregate aggregate = Aggregate::kMean;
  /// Value of an episode; none: the episode does not have the quantity. `optimal_time`: [s].
  std::optional<double> (*value)(const ResultEpisode& episode, double optimal_time) = nullptr;

  /// "points" for rates, else the unit.
  std::string_view difference_unit() const { return is_rate ? "points" : unit; }
};

/// Returns all quantities in the order of tables: success_rate (the first), success_rate_iqm,
/// success_rate_worst, collision_rate, timeout_rate, contact_rate, survival_time_s,
/// traversal_time_s, barn_score.
std::span<const Quantity> Quantities();

/// Returns the place in `Quantities` of the quantity of this key; none: there is none.
std::optional<std::size_t> FindQuantity(std::string_view key);

/// The length of a training, as far as it is known.
struct TrainingFigures {
  std::optional<double> steps{};
  std::optional<double> updates{};
  std::optional<double> imagined{};  ///< Transitions that a model imagined.
  std::optional<double> training_s{};
};

/// A number that was published of an agent, with its standard deviation over runs if that is known.
struct PublishedNumber {
  std::size_t quantity = 0;  ///< Place in `Quantities`.
  std::string source;        ///< Who published it, in words.
  double value = 0.0;
  std::optional<double> deviation{};
};

/// An agent and its evaluations, one for each seed that it was trained with. Keeps pointers to
/// results that must outlive it.
struct Agent {
  std::string label;
  bool is_trained = true;
  std::vector<const Result*> seeds;  ///< May be empty: nothing was evaluated yet.
  int num_planned = 0;               ///< Seeds that there are to be.
  /// Names the policies that drive. Agents of equal names differ in no training, so the verdict on
  /// them is about further courses, as that on two planners. Empty: not known.
  std::string policies{};
  std::optional<std::vector<TrainingFigures>> trainings{};  ///< Of each seed. None: not shown.
  std::vector<PublishedNumber> published{};
};

/// One quantity of one agent.
struct QuantityFigures {
  /// Over the episodes of all seeds. Empty if no episode has the quantity.
  std::optional<Estimate> estimate;
  /// Value of each seed that has one.
  std::vector<double> seeds;

  /// Mean of `seeds`, as papers print it. Empty if there is none.
  std::optional<double> seed_mean() const;
  /// Standard deviation of `seeds` (n - 1). Empty with fewer than two.
  std::optional<double> seed_deviation() const;
};

/// One agent of a comparison.
struct AgentFigures {
  std::string label;
  bool is_trained = true;
  int num_seeds = 0;
  int num_planned = 0;
  int num_courses = 0;                        ///< 0: no seed.
  int num_episodes = 0;                       ///< Of all seeds.
  std::vector<std::string> files;             ///< File of each seed.
  std::vector<QuantityFigures> quantities;    ///< As `Quantities`.
  std::vector<Estimate> profile;              ///< As `ProfileThresholds`; empty: no seed.
  std::optional<TrainingFigures> training{};  ///< Means over the seeds that have the number.
  std::vector<PublishedNumber> published{};

  const QuantityFigures& success() const { return quantities.front(); }
};

/// Two agents on the same courses, the first minus the second.
struct AgentPair {
  std::size_t first = 0;  ///< Places of agents.
  std::size_t second = 0;
  /// As `Quantities`: the difference of the two estimates. Empty for quantities that are no means,
  /// and if an agent has no such estimate.
  std::vector<std::optional<Estimate>> differences;
  PairedTest test;                 ///< Of success.
  Estimate improvement;            ///< Probability that the first has more success on a course.
  double corrected_p_value = 1.0;  ///< `test.p_value` by Holm, over all pairs of the group.
  std::optional<double> corrected_training_p_value;  ///< Over all pairs that have one.
  Verdict verdict = Verdict::kTooFewSeeds;           ///< On success, by the corrected p-values.
  /// Whether episodes of the same number on a course began at the same place.
  bool same_starts = true;

  /// Of success; it always has one.
  const Estimate& difference() const { return test.difference; }
};

/// The agents of one list of courses.
struct Group {
  std::string title;     ///< The courses: "static-test".
  std::string protocol;  ///< A sentence with its rules; empty: nothing was evaluated.
  int num_courses = 0;
  std::vector<std::size_t> columns;  ///< Places in `Quantities` of those that tables show.
  std::vector<AgentFigures> agents;  ///< In the order given, with those that have no seed.
  std::vector<AgentPair> pairs;      ///< Every two agents with seeds, in order.
  std::vector<std::string> notes;    ///< Sentences that a reader of the numbers needs.
  // Of whole evaluations (`CompareResults`):
  std::vector<DrawnFieldBins> drawn;
  std::vector<SettingDifferences> settings;
};

/// How agents are compared.
struct CompareOptions {
  BootstrapOptions bootstrap;
  PermutationOptions permutation;
  /// `Group::columns`. Empty: without contact_rate where a collision ends an episode, and without
  /// success_rate_iqm and success_rate_worst if no agent has several seeds.
  std::vector<std::size_t> columns;
};

/// More agents than this are not compared each with each.
inline constexpr std::size_t kMaxPairedAgents = 12;

/// Compares the agents. Pairs on different courses or by different rules are left out, which a note
/// says. Ten agents of five seeds on 300 courses take about a second.
/// Requires: the seeds of one agent are of one protocol on equally many courses.
Group CompareAgents(std::span<const Agent> agents, const CompareOptions& options = {});

// ---- Parts of it.

/// Computes the figures of one agent.
AgentFigures FiguresOf(const Agent& agent, const BootstrapOptions& options = {});

/// Estimates a quantity of an agent (`BootstrapShare`, `BootstrapRatio`,
/// `BootstrapInterquartileMean`, `BootstrapLowestTwentiethMean`). Returns nothing if no episode has
/// the quantity, or there is no seed.
std::optional<Estimate> EstimateOf(const Agent& agent, const Quantity& quantity,
                                   const BootstrapOptions& options = {});

/// Estimates the difference of two agents, pair by pair if both drove the same courses
/// (`AreOnSameCourses`). Returns nothing if an agent has no such estimate. Requires: a mean.
std::optional<Estimate> DifferenceOf(const Agent& first, const Agent& second,
                                     const Quantity& quantity,
                                     const BootstrapOptions& options = {});

/// Whether all seeds of both drove the same courses by the same rules.
bool AreOnSameCourses(const Agent& first, const Agent& second);

/// The mean of a quantity over the episodes on each course: [seed][course].
/// Requires: at least one seed, a quantity that every episode has.
ScoreTable ScoresOf(const Agent& agent, const Quantity& quantity);

/// A quantity of one evaluation. Empty if no episode has it.
std::optional<double> ValueOf(const Result& result, const Quantity& quantity);

/// Thresholds of `AgentFigures::profile`: 0, 0.05 ... 1.
std::vector<double> ProfileThresholds();

// ---- Whole evaluations.

/// Evaluations and what was found in them. Keeps a reference to the results.
struct Comparison {
  std::span<const Result> results;
  std::vector<AgentResults> agents;
  std::vector<Group> groups;  ///< As `GroupByCourses`; the agents of one are those of `AgentsIn`.
};

/// Compares evaluations, in a group for each list of courses. An agent with results on several
/// lists is in each of these groups. Requires: one protocol; each result belongs to one agent, and
/// all seeds of an agent are alike (`RequireComparable`).
Comparison CompareResults(std::span<const Result> results, std::vector<AgentResults> agents,
                          const CompareOptions& options = {});

/// Throws `base::Error` that names two files and their difference unless all results are of one
/// protocol, on the same courses, with equally many episodes on each course from the same starts.
/// Also throws if a course has no episode.
void RequireComparable(std::span<const Result> results);

}  // namespace slalom::eval
