#pragma once

#include <span>
#include <string>

#include "app/sweep/report/report_content.h"

namespace slalom::sweep {

/// Returns the report in Markdown: provenance, a table for each score, comparisons of rows, and
/// what is missing.
std::string MarkdownReport(const ReportContent& content);

/// Returns its part that goes into a page with several reports: where the numbers come from, and
/// the tables in the paper's layout.
std::string MarkdownSummary(const ReportContent& content);

/// Returns the first table in the paper's layout. Empty: there is none.
std::string MarkdownTable(const ReportContent& content);

/// Returns a table of the conclusions of several plans: each with its figures and what they say of
/// it.
std::string MarkdownConclusions(std::span<const ReportContent> contents);

/// Returns a Markdown page with its blocks replaced. A block lies between two lines and has
/// one of these beginnings, where NAME is the name of a plan:
///
///     <!-- sweep table NAME -->     `MarkdownTable`
///     <!-- sweep summary NAME -->   `MarkdownSummary`
///     <!-- sweep conclusions -->         `MarkdownConclusions` of all plans
///     <!-- end of sweep -->
///
/// Blocks of other plans stay as they are. `source` names the page in errors. Throws `base::Error`
/// with the line if a block is of another kind or has no end, or if there is none to fill.
std::string FillBlocks(const std::string& page, const std::string& source,
                       std::span<const ReportContent> contents);

}  // namespace slalom::sweep
