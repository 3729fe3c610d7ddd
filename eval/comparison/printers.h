#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

#include "eval/comparison/comparison.h"
#include "eval/report/table_text.h"

/// A comparison in each of its forms.

namespace slalom::eval {

// ---- Markdown. Tables are returned as such, so that a caller may add columns.

/// "success [%]"; "success [points]" for a difference.
std::string TitleOf(const Quantity& quantity, bool is_difference = false);

/// "3", "**2 of 3**", or "–" for a planner, which has no seeds.
std::string SeedsText(const AgentFigures& agent);

/// A line for each agent: its label, seeds, episodes, `columns` with their intervals, and steps and
/// time of the training if an agent has it.
MarkdownTable FiguresTable(std::span<const AgentFigures> agents,
                           std::span<const std::size_t> columns);

/// A line for each pair: labels, the difference in success with its interval, p of the policies and
/// p of the trainings (both corrected), the verdict, and the chance that the first is better.
MarkdownTable PairTable(const Group& group);

/// A line for each pair: labels, and the differences in the other means that the group shows.
MarkdownTable DifferenceTable(const Group& group);

/// How to read `FiguresTable` and `PairTable`.
extern const std::string_view kFiguresLegend;
extern const std::string_view kPairLegend;

/// The groups, whole: tables, legends, notes, success by randomised fields and settings.
/// Requires: at least one.
std::string MarkdownOf(std::span<const Group> groups);

// ---- CSV, with a line for each agent. Cells without a value are empty.

/// "seeds,planned_seeds,courses,episodes", then for each quantity of `Quantities`
/// ",KEY,KEY_low,KEY_high,KEY_seed_mean,KEY_deviation".
std::string FiguresCsvHead();
/// The fields below `FiguresCsvHead`.
std::string FiguresCsvFields(const AgentFigures& agent);

/// "course_set,agent,is_trained,", `FiguresCsvHead` and the files, then a line for each agent of
/// each group.
std::string FiguresCsv(std::span<const Group> groups);
/// A line for each pair of each group: differences with intervals, p-values, verdict.
std::string PairsCsv(std::span<const Group> groups);

// ---- JSON, for pages and --json.

/// A list with an object for each quantity: key, title, unit, difference_unit, factor, digits,
/// higher_is_better, limit (null: none).
nlohmann::json QuantitiesJson();

/// {label, is_trained, seeds, planned, courses, episodes, files, figures: {KEY: {estimate: [value,
/// low, high], mean, deviation, seeds: [...]}}, profile: [[value, low, high], ...]}. An agent with
/// a training has also its {steps, updates, imagined, training_s}, and one with published numbers
/// {published: {KEY: [{source, value, deviation}, ...]}}.
nlohmann::json JsonOf(const AgentFigures& agent);

/// {first, second, differences: {KEY: [value, low, high]}, improvement, p, p_corrected, training_p,
/// training_p_corrected, verdict, same_starts}
nlohmann::json JsonOf(const AgentPair& pair);

/// {title, protocol, num_courses, columns: [KEY], agents, pairs, notes, drawn,
/// settings}
nlohmann::json JsonOf(const Group& group);

}  // namespace slalom::eval
