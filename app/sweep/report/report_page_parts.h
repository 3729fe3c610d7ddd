#pragma once

#include <string_view>

/// The files of app/sweep/report/report_page/ and what they share with the page of `slalom report`,
/// put into the program at build time (cmake/EmbedPage.cmake).

namespace slalom::sweep {

extern const std::string_view kSweepPageHtml;    ///< With marks where the other parts go.
extern const std::string_view kSweepPageStyle;   ///< CSS.
extern const std::string_view kSweepPageScript;  ///< JavaScript.

}  // namespace slalom::sweep
