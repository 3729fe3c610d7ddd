#pragma once

#include <filesystem>
#include <string>

#include "eval/comparison/comparison.h"

namespace slalom::eval {

/// Returns the data of a report's page as compact JSON (docs/evaluation.md, "The page"). Numbers
/// are those of the comparison. Tracks, scans, courses and motions are rounded and thinned, so that
/// the page has a few MB for any number of results and courses.
/// Requires: at least one result.
std::string ReportPageData(const Comparison& comparison);

/// Returns one HTML page with everything in it, which opens without a network: figures, pairs and
/// their verdicts, success by course and by difficulty, times, trajectories, and episodes that can
/// be played. Requires the same as `ReportPageData`.
std::string ReportPage(const Comparison& comparison);

/// Writes the page as report.html, `MarkdownOf` as report.md, `FiguresCsv` as report.csv and
/// `PairsCsv` as report-pairs.csv into `directory`, which is made if it is missing. Requires the
/// same as `ReportPageData`. Throws `base::Error` if a file cannot be written.
void WriteReport(const Comparison& comparison, const std::filesystem::path& directory);

}  // namespace slalom::eval
