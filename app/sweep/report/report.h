#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "app/sweep/report/report_content.h"
#include "eval/comparison/pivot.h"

/// The report of a sweep, at any time: cells that are not done are listed as missing.
/// docs/sweeps.md explains it.

namespace slalom::sweep {

/// Returns the tables of a report in the layout of papers: mean and standard deviation over seeds,
/// and the published numbers.
///
/// If rows have two labels or more, each quantity has a table: the last label gives the columns,
/// below a head for each score, and the others the lines. If they have one, each quantity of
/// `sweep.quantities` has a table with rows as lines and scores as columns; if the plan names none,
/// each score has one with quantities as lines and rows as columns. Scores with snapshots have
/// another, with steps as columns. Without scores, there is none.
std::vector<eval::Pivot> CrossTables(const ReportContent& content);

/// Writes the report into `PlanDirectory(store, plan.sweep.name)`, each file atomically:
///
///     report.html       one page with figures, which opens without a network
///     report.md         the same tables in Markdown, after the source of the numbers, the cross
///                       tables and the conclusions; failures, and what is missing
///     report.csv        a line for each cell and score
///     report-rows.csv   a line for each row and score: means, intervals, deviations
///
/// Throws `base::Error` if a file cannot be written.
void WriteSweepReport(const ReportContent& content, const std::filesystem::path& store);

/// Returns a table for the terminal: success of each row on each score in percent, with its 95 %
/// interval, and the number of its seeds if some are missing. If there are more scores than rows,
/// scores are its lines. Lines end in newlines.
std::string SweepSummary(const ReportContent& content);

/// Returns one HTML page with everything in it, which opens without a network: tables, success over
/// numeric axes, learning curves, performance profiles, comparisons of rows.
std::string SweepPage(const ReportContent& content);

/// Returns CSV with one line for each evaluation that the plan asks for. If one is missing, `state`
/// says why, and the cells of its numbers are empty. Rates are shares from 0 to 1.
std::string CellCsv(const ReportContent& content);

/// Returns CSV with one line for each row, score and snapshot: labels, `eval::FiguresCsvFields`,
/// and means of the trainings.
std::string RowCsv(const ReportContent& content);

/// Returns a table of the conclusions of several plans: each with its figures and its verdict.
std::string MarkdownConclusions(std::span<const ReportContent> contents);

/// Returns a Markdown page with its blocks replaced. A block lies between two lines and has one of
/// these beginnings, with the name of a plan for NAME:
///
///     <!-- sweep table NAME -->     the first of `CrossTables`
///     <!-- sweep summary NAME -->   the source of the numbers, and all of `CrossTables`
///     <!-- sweep conclusions -->    `MarkdownConclusions` of all plans; with a NAME, of that one
///     <!-- end of sweep -->
///
/// Blocks of other plans stay as they are. `source` names the page in errors. Throws `base::Error`
/// with the line if a block is of another kind or has no end, or if there is none to fill.
std::string FillBlocks(const std::string& page, const std::string& source,
                       std::span<const ReportContent> contents);

}  // namespace slalom::sweep
