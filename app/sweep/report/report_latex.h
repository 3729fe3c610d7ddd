#pragma once

#include <string>

#include "app/sweep/report/report_content.h"

namespace slalom::sweep {

/// Returns the tables of `MakeGrids` in LaTeX, with booktabs and multirow.
std::string LatexReport(const ReportContent& content);

}  // namespace slalom::sweep
