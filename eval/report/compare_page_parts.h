#pragma once

#include <string_view>

/// The files of eval/report/compare_page/ and what they share with the report, put into the program
/// at build time (cmake/EmbedPage.cmake).

namespace slalom::eval {

extern const std::string_view kComparePageHtml;    ///< With marks where the other parts go.
extern const std::string_view kComparePageStyle;   ///< CSS.
extern const std::string_view kComparePageScript;  ///< JavaScript.

}  // namespace slalom::eval
