#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "base/result.h"

/// New priorities of sampled rows as one run of bytes, as a learner sends them: sequence [C] int64,
/// priority [C] float32, one right after the other, little-endian.

namespace slalom::replay {

/// Bytes of `count` >= 0 priorities.
std::size_t PrioritySize(int count);

/// Writes them. Requires: as many of each; out.size() == PrioritySize(...) and starts on a multiple
/// of 8 bytes.
void WritePriorities(std::span<const std::int64_t> sequence, std::span<const float> priority,
                     std::span<std::byte> out);

/// Views only.
struct PriorityView {
  std::span<const std::int64_t> sequence;  ///< [C] >= 0; such a row need not be there (any more).
  std::span<const float> priority;         ///< [C] finite, >= 0
};

/// Looks at bytes that anybody may have sent. Fails where their number is not that of so many
/// priorities, they do not start on a multiple of 8 bytes, or a number is out of the ranges above.
base::Result<PriorityView> ParsePriorities(std::span<const std::byte> bytes, int count);

}  // namespace slalom::replay
