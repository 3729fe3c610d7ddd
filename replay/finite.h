#pragma once

#include <cstddef>
#include <span>

namespace slalom::replay {

/// Returns the index of the first value that is not finite, or values.size() if all are finite.
std::size_t FirstNotFinite(std::span<const float> values);

}  // namespace slalom::replay
