#pragma once

#include <cstdint>
#include <span>
#include <string>

/// Compact encoding of numbers for the page of a report (eval/report/report_page.h), which decodes
/// them.

namespace slalom::eval {

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
