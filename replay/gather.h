#pragma once

#include <cstdint>
#include <span>

namespace slalom::replay {

/// Copies scans to `out`, [scans.size(), num_beams]. Each scan is prefetched some scans ahead.
void GatherScans(std::span<const std::uint16_t* const> scans, int num_beams, std::uint16_t* out);

}  // namespace slalom::replay
