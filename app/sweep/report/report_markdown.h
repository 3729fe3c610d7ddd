#pragma once

#include <string>

#include "app/sweep/report/report_content.h"

namespace slalom::sweep {

/// Returns the report in Markdown: provenance, a table for each score, comparisons of rows, and
/// what is missing.
std::string MarkdownReport(const ReportContent& content);

}  // namespace slalom::sweep
