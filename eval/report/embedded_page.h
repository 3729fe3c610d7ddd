#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

/// HTML pages with everything in them, which open without a network.

namespace slalom::eval {

/// Returns the JSON compactly, as it may stand in a `<script>` element. Bytes that are not UTF-8
/// are replaced, and no text in it can end the element.
std::string JsonForPage(const nlohmann::json& json);

/// Returns `html` with its marks /*STYLE*/, /*SCRIPT*/ and /*DATA*/ replaced.
/// Requires: it has all three; `data` is from `JsonForPage`.
std::string FillPage(std::string_view html, std::string_view style, std::string_view script,
                     std::string_view data);

}  // namespace slalom::eval
