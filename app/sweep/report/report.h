#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "app/sweep/report/report_content.h"
#include "app/sweep/results.h"

/// The report of a sweep, at any time: cells that are not done are listed as missing.
/// docs/sweeps.md explains it. Each form of it is in a source of its own.

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
/// interval, and the number of its seeds. If there are more scores than rows, scores are its lines.
/// Lines end in newlines.
std::string SweepSummary(const SweepResults& results);

/// Returns one HTML page with everything in it, which opens without a network: tables, success over
/// numeric axes, curves of sample efficiency, performance profiles, comparisons of rows.
std::string SweepPage(const ReportContent& content);

/// Returns CSV with one line for each evaluation that the plan asks for. If one is missing, `state`
/// says why, and the cells of its numbers are empty. Rates are shares from 0 to 1.
std::string CellCsv(const ReportContent& content);

/// Returns CSV with one line for each row, score and snapshot: for each quantity the estimate over
/// all seeds with both ends of its 95 % interval, mean and standard deviation of the seeds' values,
/// and the published numbers. Cells without a value are empty.
std::string RowCsv(const ReportContent& content);

/// Returns the tables of `MakeGrids` in LaTeX, with booktabs and multirow.
std::string LatexReport(const ReportContent& content);

/// Returns the report in Markdown: provenance, a table for each score, comparisons of rows, and the
/// missing results.
std::string MarkdownReport(const ReportContent& content);

/// Returns its part that goes into a page with several reports: the source of the numbers, and the
/// tables in the paper's layout.
std::string MarkdownSummary(const ReportContent& content);

/// Returns the first table in the paper's layout, or an empty text if there is none.
std::string MarkdownTable(const ReportContent& content);

/// Returns a table of the conclusions of several plans: each with its figures and its verdict.
std::string MarkdownConclusions(std::span<const ReportContent> contents);

/// Returns a Markdown page with its blocks replaced. A block lies between two lines and has one of
/// these beginnings, with the name of a plan for NAME:
///
///     <!-- sweep table NAME -->     `MarkdownTable`
///     <!-- sweep summary NAME -->   `MarkdownSummary`
///     <!-- sweep conclusions -->    `MarkdownConclusions` of all plans
///     <!-- end of sweep -->
///
/// Blocks of other plans stay as they are. `source` names the page in errors. Throws `base::Error`
/// with the line if a block is of another kind or has no end, or if there is none to fill.
std::string FillBlocks(const std::string& page, const std::string& source,
                       std::span<const ReportContent> contents);

}  // namespace slalom::sweep
