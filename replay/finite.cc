#include "replay/finite.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

namespace slalom::replay {

std::size_t FirstNotFinite(std::span<const float> values) {
  // First checks whether there is any, by the bits of the exponent, as that vectorises.
  constexpr std::uint32_t kExponent = 0x7f800000;
  std::uint32_t any = 0;
  for (const float value : values) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    any |= static_cast<std::uint32_t>((bits & kExponent) == kExponent);
  }
  if (any == 0) return values.size();
  return static_cast<std::size_t>(
      std::find_if(values.begin(), values.end(), [](float v) { return !std::isfinite(v); }) -
      values.begin());
}

}  // namespace slalom::replay
