#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/result.h"

/// New priorities of sampled rows as a learner sends them, in one block of bytes: sequence [C]
/// int64, priority [C] float32, without padding, little-endian.

namespace slalom::replay {

/// Returns the size of `count` priorities in bytes. Requires: count >= 0.
std::size_t PrioritySize(int count);

/// Writes priorities to `out`. Requires: both spans have the same size; out.size() ==
/// PrioritySize(...); `out` starts on a multiple of 8 bytes.
void WritePriorities(std::span<const std::int64_t> sequence, std::span<const float> priority,
                     std::span<std::byte> out);

/// Views only.
struct PriorityView {
  std::span<const std::int64_t> sequence;  ///< [C] >= 0; the table may no longer hold such a row.
  std::span<const float> priority;         ///< [C] finite, >= 0
};

/// Parses bytes from an untrusted peer. Fails if their number is not that of `count` priorities, if
/// they do not start on a multiple of 8 bytes, or if a value is outside the ranges above.
base::Result<PriorityView> ParsePriorities(std::span<const std::byte> bytes, int count);

}  // namespace slalom::replay
