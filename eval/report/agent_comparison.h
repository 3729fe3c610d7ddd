#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "eval/report/comparison.h"
#include "eval/report/result.h"
#include "eval/report/setting_differences.h"
#include "eval/statistics/bootstrap.h"
#include "eval/statistics/permutation.h"
#include "eval/statistics/score_table.h"

/// Agents of several seeds each, compared on one list of courses. docs/statistics.md says how the
/// numbers are made and read.

namespace slalom::eval {

/// Throws `base::Error` that names two files and their difference unless all results are of one
/// protocol, on the same courses, with equally many episodes on each course from the same starts.
/// Also throws if a course has no episode.
void RequireComparable(std::span<const Result> results);

/// Returns the share of episodes on each course that ended with `outcome`.
/// Requires: at least one result; all of them are comparable (`RequireComparable`).
ScoreTable OutcomeTable(std::span<const Result> results, const AgentResults& agent,
                        env::Outcome outcome);

/// One agent of a comparison.
struct AgentFigures {
  std::string label;
  int num_seeds = 0;
  std::vector<std::string> files;          ///< File of each seed.
  std::vector<double> seed_success;        ///< Success rate of each seed.
  Estimate success_rate;                   ///< Mean over seeds and courses.
  Estimate interquartile_success;          ///< Interquartile mean of the success rates.
  Estimate collision_rate;                 ///< Share of episodes that a collision ended.
  std::optional<Estimate> traversal_time;  ///< Mean over successful episodes, [s].
  std::vector<Estimate> profile;           ///< At the thresholds of the comparison.
};

/// Two agents of a comparison, the earlier minus the later, by their success rates.
struct AgentPair {
  std::size_t first = 0;  ///< Indices of agents.
  std::size_t second = 0;
  PairedTest test;
  Estimate improvement;            ///< Probability that the first is better on a course.
  double corrected_p_value = 1.0;  ///< `test.p_value` by Holm, over all pairs.
  std::optional<double> corrected_training_p_value;  ///< Over all pairs that have one.
  Verdict verdict = Verdict::kTooFewSeeds;           ///< By the corrected p-values.
};

/// Compares two agents. The p-values are corrected, and the verdict found, by `CorrectPValues`.
/// Requires: the same courses in the same order.
AgentPair ComparePair(std::size_t first_index, const ScoreTable& first, std::size_t second_index,
                      const ScoreTable& second, const BootstrapOptions& bootstrap = {},
                      const PermutationOptions& permutation = {});

/// Corrects the p-values of all pairs of a table for their number, and finds the verdicts.
void CorrectPValues(std::span<AgentPair> pairs);

/// A comparison, whole. A value.
struct AgentComparison {
  std::string title;     ///< The courses: "static-test".
  std::string protocol;  ///< A sentence with its rules.
  int num_courses = 0;
  std::vector<double> thresholds;  ///< Thresholds of the performance profiles.
  std::vector<AgentFigures> agents;
  std::vector<AgentPair> pairs;    ///< Every two agents, in order.
  std::vector<std::string> notes;  ///< Sentences that a reader of the numbers needs.
  std::vector<SettingDifferences> settings;
};

/// Compares the agents. Ten agents of five seeds on 300 courses take about a second.
/// Requires: at least one agent; comparable results (`RequireComparable`).
AgentComparison CompareAgents(std::span<const Result> results, std::span<const AgentResults> agents,
                              const BootstrapOptions& bootstrap = {},
                              const PermutationOptions& permutation = {});

/// Returns the comparison in Markdown: a table of agents, a table of pairs, the notes, and a table
/// of the settings in which agents differ.
std::string MarkdownOf(const AgentComparison& comparison);

/// Returns CSV with a line for every number: agent, against (of pairs), quantity, threshold (of
/// profiles), value, low, high. Cells without a value are empty.
std::string CsvOf(const AgentComparison& comparison);

/// Returns one HTML page with everything in it, which opens without a network: scores and
/// differences as dots with their intervals, performance profiles, every number as a table, and the
/// settings in which agents differ.
std::string ComparisonPage(const AgentComparison& comparison);

/// Returns the data of the page as compact JSON (docs/statistics.md, "The page").
std::string ComparisonPageData(const AgentComparison& comparison);

}  // namespace slalom::eval
