#pragma once

#include <span>
#include <string>

#include "eval/report/result.h"

namespace slalom::eval {

/// Returns the data of a report's page as compact JSON (docs/evaluation.md, "The page"). Statistics
/// are as in the results. Tracks, scans, courses and motions are rounded and thinned, so that the
/// page has a few MB for any number of results and courses.
/// Requires: at least one result, one protocol (`RequireSameProtocol`).
std::string ReportPageData(std::span<const Result> results);

/// Returns one HTML page with everything in it, which opens without a network: a table, success by
/// course and by difficulty, times, trajectories, and episodes that can be played. Requires the
/// same as `ReportPageData`.
std::string ReportPage(std::span<const Result> results);

}  // namespace slalom::eval
