#pragma once

#include <string_view>

/// The files of app/watch/page/, embedded at build time (cmake/EmbedPage.cmake).

namespace slalom::watch {

extern const std::string_view kWatchPageHtml;    ///< With marks for the other parts.
extern const std::string_view kWatchPageStyle;   ///< CSS, that of the report first.
extern const std::string_view kWatchPageScript;  ///< JavaScript.

}  // namespace slalom::watch
