#pragma once

#include <string_view>

/// The files of eval/report/compare_page/ and the files that they share with the report, embedded
/// at build time (cmake/EmbedPage.cmake).

namespace slalom::eval {

extern const std::string_view kComparePageHtml;    ///< With marks for the other parts.
extern const std::string_view kComparePageStyle;   ///< CSS.
extern const std::string_view kComparePageScript;  ///< JavaScript.

}  // namespace slalom::eval
