#pragma once

#include <cstdint>
#include <span>
#include <string>

/// Numbers made small for the page of a report (eval/report_page.h), which unpacks them.

namespace slalom::eval {

/// Base64 (RFC 4648, with padding).
std::string Base64(std::span<const std::uint8_t> bytes);

/// Numbers as multiples of one scale.
struct PackedNumbers {
  double scale = 0.0;
  std::string base64;  ///< Of their 16-bit signed integers, lower byte first.
};

/// Each number within half a scale, which is `resolution` or, where the largest number asks for
/// more, 1/32000 of that. Requires: resolution > 0, numbers finite.
PackedNumbers PackNumbers(std::span<const double> numbers, double resolution);

}  // namespace slalom::eval
