#pragma once

#include <cstddef>
#include <span>

namespace slalom::replay {

/// The place of the first number that is not finite; values.size() where all are. Reads several
/// at once.
std::size_t FirstNotFinite(std::span<const float> values);

}  // namespace slalom::replay
