#pragma once

#include <cstdint>
#include <span>

namespace slalom::replay {

/// Copies scans from wherever they lie to [scans.size(), num_beams] at `out`, each asked for from
/// memory some scans before its turn.
void GatherScans(std::span<const std::uint16_t* const> scans, int num_beams, std::uint16_t* out);

}  // namespace slalom::replay
