#pragma once

#include <filesystem>
#include <string>

#include "app/sweep/report/report_content.h"
#include "app/sweep/results.h"

/// The report of a sweep, at any time: cells that are not done are listed as missing.
/// docs/sweeps.md explains it.

namespace slalom::sweep {

/// Writes the report into `PlanDirectory(store, plan.sweep.name)`, each file atomically:
///
///     report.html       one page with figures, which opens without a network
///     report.md         the same tables for people and repositories
///     report.csv        a line for each cell and score
///     report-rows.csv   a line for each row and score: means, intervals, published numbers
///     report.tex        tables in the layout of the paper's
///
/// Throws `base::Error` if a file cannot be written.
void WriteSweepReport(const ReportContent& content, const std::filesystem::path& store);

/// Returns a table for the terminal: success of each row on each score in percent, with its 95 %
/// interval, and the number of its seeds. Lines end in newlines.
std::string SweepSummary(const SweepResults& results);

}  // namespace slalom::sweep
