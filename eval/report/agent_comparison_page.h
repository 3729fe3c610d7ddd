#pragma once

#include <string>

#include "eval/report/agent_comparison.h"

namespace slalom::eval {

/// Returns one HTML page with everything in it, which opens without a network: scores and
/// differences as dots with their intervals, performance profiles, and every number as a table.
std::string ComparisonPage(const AgentComparison& comparison);

/// Returns the data of the page as compact JSON (docs/statistics.md, "The page").
std::string ComparisonPageData(const AgentComparison& comparison);

}  // namespace slalom::eval
