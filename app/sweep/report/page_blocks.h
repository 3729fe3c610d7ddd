#pragma once

#include <span>
#include <string>

#include "app/sweep/report/report_content.h"

namespace slalom::sweep {

/// Returns a Markdown page with its blocks replaced. A block lies between two lines and has one of
/// these beginnings, with the name of a plan for NAME:
///
///     <!-- sweep table NAME -->     the first of `CrossTables`
///     <!-- sweep summary NAME -->   `MarkdownSummary`
///     <!-- sweep conclusions -->    `MarkdownConclusions` of all plans; with a NAME, of that one
///     <!-- end of sweep -->
///
/// Blocks of other plans stay as they are. `source` names the page in errors. Throws `base::Error`
/// with the line if a block is of another kind or has no end, or if there is none to fill.
std::string FillBlocks(const std::string& page, const std::string& source,
                       std::span<const ReportContent> contents);

}  // namespace slalom::sweep
