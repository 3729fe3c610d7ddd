#pragma once

#include <span>
#include <string>

#include "eval/result.h"

namespace slalom::eval {

/// What the page of a report shows, as compact JSON (docs/evaluation.md, "The page"): figures as
/// they stand in the results; tracks, scans, courses and motions rounded and thinned so that the
/// page stays a few MB, whatever the number of results and courses.
/// Requires: at least one result, one protocol (`RequireSameProtocol`).
std::string ReportPageData(std::span<const Result> results);

/// One HTML page with everything in it, which opens without a network: table, success by course and
/// by difficulty, times, trajectories, and episodes played back. With its requirements.
std::string ReportPage(std::span<const Result> results);

}  // namespace slalom::eval
