#pragma once

#include <vector>

#include "app/sweep/report/report_content.h"
#include "eval/comparison/pivot.h"

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

}  // namespace slalom::sweep
