#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

/// HTML pages with everything in them, which open without a network. `slalom_embed_page`
/// (cmake/SlalomTargets.cmake) puts them into the program; their data is added here.

namespace slalom::eval {

/// Returns the JSON compactly, as it may stand in a `<script>` element. Bytes that are not UTF-8
/// are replaced, and no text in it can end the element.
std::string JsonForPage(const nlohmann::json& json);

/// Returns an embedded page with its data. Requires: `page` has the mark /*DATA*/; `data` is from
/// `JsonForPage`.
std::string FillPage(std::string_view page, std::string_view data);

}  // namespace slalom::eval
