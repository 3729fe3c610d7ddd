#pragma once

#include <string_view>

/// The files of app/sweep/report/report_page/ and the files that they share with the page of
/// `slalom report`, embedded at build time (cmake/EmbedPage.cmake).

namespace slalom::sweep {

extern const std::string_view kSweepPageHtml;    ///< With marks for the other parts.
extern const std::string_view kSweepPageStyle;   ///< CSS.
extern const std::string_view kSweepPageScript;  ///< JavaScript.

}  // namespace slalom::sweep
