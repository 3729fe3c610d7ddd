#include "replay/priority_bytes.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>

#include "base/check.h"
#include "replay/finite.h"

namespace slalom::replay {

static_assert(std::endian::native == std::endian::little, "priorities are sent little-endian");

std::size_t PrioritySize(int count) {
  SLALOM_CHECK_GE(count, 0);
  return static_cast<std::size_t>(count) * (sizeof(std::int64_t) + sizeof(float));
}

void WritePriorities(std::span<const std::int64_t> sequence, std::span<const float> priority,
                     std::span<std::byte> out) {
  SLALOM_CHECK_EQ(sequence.size(), priority.size());
  SLALOM_CHECK_EQ(out.size(), sequence.size_bytes() + priority.size_bytes());
  if (sequence.empty()) return;
  std::memcpy(out.data(), sequence.data(), sequence.size_bytes());
  std::memcpy(out.data() + sequence.size_bytes(), priority.data(), priority.size_bytes());
}

base::Result<PriorityView> ParsePriorities(std::span<const std::byte> bytes, int count) {
  if (count < 0 || bytes.size() != PrioritySize(count)) {
    return base::Failure{
        fmt::format("priorities: found {} bytes, expected 12 for each of {}", bytes.size(), count)};
  }
  if (reinterpret_cast<std::uintptr_t>(bytes.data()) % alignof(std::int64_t) != 0) {
    return base::Failure{"priorities: they do not start on a multiple of 8 bytes"};
  }
  const auto n = static_cast<std::size_t>(count);
  const auto* const sequences = reinterpret_cast<const std::int64_t*>(bytes.data());
  const PriorityView view{{sequences, n}, {reinterpret_cast<const float*>(sequences + n), n}};
  for (std::size_t i = 0; i < n; ++i) {
    if (view.sequence[i] < 0) {
      return base::Failure{
          fmt::format("priority {}: row {}, expected 0 or more", i, view.sequence[i])};
    }
    if (!(view.priority[i] >= 0.0f)) {
      return base::Failure{
          fmt::format("priority {}: found {}, expected 0 or more", i, view.priority[i])};
    }
  }
  if (const std::size_t bad = FirstNotFinite(view.priority); bad < n) {
    return base::Failure{fmt::format("priority {}: it is not finite", bad)};
  }
  return view;
}

}  // namespace slalom::replay
