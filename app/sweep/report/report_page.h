#pragma once

#include <string>

#include "app/sweep/report/report_content.h"

namespace slalom::sweep {

/// Returns the data of the page as compact JSON that is safe in a `<script>` element.
std::string SweepPageData(const ReportContent& content);

/// Returns one HTML page with everything in it, which opens without a network: tables, success over
/// numeric axes, curves of sample efficiency, performance profiles, comparisons of rows.
std::string SweepPage(const ReportContent& content);

}  // namespace slalom::sweep
