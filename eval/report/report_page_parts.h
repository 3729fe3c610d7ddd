#pragma once

#include <string_view>

/// The files of eval/report/report_page/, embedded at build time (cmake/EmbedPage.cmake).

namespace slalom::eval {

extern const std::string_view kReportPageHtml;    ///< With marks for the other parts.
extern const std::string_view kReportPageStyle;   ///< CSS.
extern const std::string_view kReportPageScript;  ///< JavaScript.

}  // namespace slalom::eval
