#pragma once

#include <string>

#include "app/sweep/report/report_content.h"

namespace slalom::sweep {

/// Returns one HTML page with everything in it, which opens without a network: tables, success over
/// numeric axes, curves of sample efficiency, performance profiles, comparisons of rows.
std::string SweepPage(const ReportContent& content);

}  // namespace slalom::sweep
