#pragma once

#include <string>

#include "eval/report/agent_comparison.h"

/// The tables of a comparison of agents.

namespace slalom::eval {

/// Returns the comparison in Markdown: a table of agents, a table of pairs, and the notes.
std::string MarkdownOf(const AgentComparison& comparison);

/// Returns CSV with a line for every number: agent, against (of pairs), quantity, threshold (of
/// profiles), value, low, high. Cells without a value are empty.
std::string CsvOf(const AgentComparison& comparison);

/// Returns both tables in LaTeX with booktabs.
std::string LatexOf(const AgentComparison& comparison);

}  // namespace slalom::eval
