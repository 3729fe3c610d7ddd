#include "replay/scan_mirror.h"

#include <algorithm>
#include <cstddef>

#include "base/check.h"

namespace slalom::replay {

MirroredRows::MirroredRows(std::int64_t num_places)
    : num_places_(num_places),
      rounds_(static_cast<std::size_t>(num_places) * sizeof(std::uint32_t)) {
  SLALOM_CHECK(num_places >= 1 && num_places <= kMaxMirrorPlaces);
}

std::int32_t MirroredRows::Take(std::int64_t row) {
  SLALOM_CHECK_GE(row, 0);
  const auto place = static_cast<std::int32_t>(row % num_places_);
  const auto round = static_cast<std::uint32_t>(1 + row / num_places_);
  std::uint32_t& here = reinterpret_cast<std::uint32_t*>(rounds_.data())[place];
  if (here == round) return place;
  here = round;
  return ~place;
}

ScanMirror::ScanMirror(std::int64_t num_places, int num_beams)
    : num_beams_(num_beams),
      scans_(static_cast<std::size_t>(num_places) * static_cast<std::size_t>(num_beams) *
             sizeof(std::uint16_t)),
      is_held_(static_cast<std::size_t>(num_places)) {
  SLALOM_CHECK(num_places >= 0 && num_places <= kMaxMirrorPlaces && num_beams >= 1);
}

std::uint16_t* ScanMirror::At(std::int32_t place) const {
  auto* const scans = reinterpret_cast<std::uint16_t*>(const_cast<std::byte*>(scans_.data()));
  return scans + static_cast<std::ptrdiff_t>(place) * num_beams_;
}

const std::uint16_t* ScanMirror::Find(std::int32_t place) const {
  if (const auto it = came_.find(place); it != came_.end()) return it->second;
  return is_held_[static_cast<std::size_t>(place)] ? At(place) : nullptr;
}

void ScanMirror::Keep() {
  for (const auto& [place, scan] : came_) {
    std::copy_n(scan, num_beams_, At(place));
    is_held_[static_cast<std::size_t>(place)] = true;
  }
  came_.clear();
}

void ScanMirror::Clear() {
  came_.clear();
  std::fill(is_held_.begin(), is_held_.end(), false);
}

}  // namespace slalom::replay
