#pragma once

#include <string>

#include "app/sweep/report/report_content.h"

namespace slalom::sweep {

/// Returns CSV with one line for each evaluation that the plan asks for. If one is missing, `state`
/// says why, and the cells of its numbers are empty. Rates are shares from 0 to 1.
std::string CellCsv(const ReportContent& content);

/// Returns CSV with one line for each row, score and snapshot: for each quantity the estimate over
/// all seeds with both ends of its 95 % interval, mean and standard deviation of the seeds' values,
/// and the published numbers. Cells without a value are empty.
std::string RowCsv(const ReportContent& content);

}  // namespace slalom::sweep
