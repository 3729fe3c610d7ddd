#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "eval/statistics/statistics.h"

/// HTML pages with everything in them, which open without a network. `slalom_embed_page`
/// (cmake/SlalomTargets.cmake) puts them into the program; their data is added here.

namespace slalom::eval {

/// Returns the JSON compactly, as it may stand in a `<script>` element. Bytes that are not UTF-8
/// are replaced, and no text in it can end the element.
std::string JsonForPage(const nlohmann::json& json);

/// Returns an embedded page with its data. Requires: `page` has the mark /*DATA*/; `data` is from
/// `JsonForPage`.
std::string FillPage(std::string_view page, std::string_view data);

/// Returns [value, low, high], with null for the ends of an interval that does not exist, or null.
nlohmann::json JsonOf(const std::optional<Estimate>& estimate);

/// Returns the number or null.
nlohmann::json JsonOf(const std::optional<double>& number);

/// Encodes bytes as Base64 (RFC 4648, with padding).
std::string Base64(std::span<const std::uint8_t> bytes);

/// Numbers as multiples of one scale.
struct PackedNumbers {
  double scale = 0.0;
  std::string base64;  ///< 16-bit signed integers, lower byte first.
};

/// Rounds each number to a multiple of the scale. The scale is `resolution` or, if that is too
/// small for the largest number, 1/32000 of that number. Requires: resolution > 0, numbers finite.
PackedNumbers PackNumbers(std::span<const double> numbers, double resolution);

}  // namespace slalom::eval
