#pragma once

#include <string>

#include "app/sweep/report/report_content.h"

namespace slalom::sweep {

/// Returns tables for a paper: mean and standard deviation over seeds, the best in bold, and below
/// each line the published numbers.
///
/// Where rows have two labels or more, the last one gives the columns, the scores their heads, and
/// the others the lines; each quantity has its table. Where rows have one label, each score has a
/// table: rows side by side and quantities below one another, or the other way round if there are
/// more than six rows. Where snapshots were scored, another table has their steps as columns.
std::string LatexReport(const ReportContent& content);

}  // namespace slalom::sweep
