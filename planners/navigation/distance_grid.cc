#include "planners/navigation/distance_grid.h"

#include <cstddef>
#include <cstdint>

namespace slalom::planners {

void DistanceGrid::Start(const Costmap& costmap, std::span<const CellIndex> under_robot,
                         std::span<const CellIndex> targets) {
  stride_ = costmap.size_x() + 2;
  distances_.assign(static_cast<std::size_t>(stride_) * (costmap.size_y() + 2), kNoWay);
  wave_.resize(distances_.size());
  for (int y = 0; y < costmap.size_y(); ++y) {
    const std::uint8_t* const costs = costmap.costs().data() + costmap.Index({0, y});
    std::uint16_t* const row = distances_.data() + Index({0, y});
    for (int x = 0; x < costmap.size_x(); ++x) {
      row[x] = costs[x] >= kInscribedCost ? kNoWay : kNotReached;
    }
  }
  for (const CellIndex c : under_robot) distances_[Index(c)] = kNotReached;
  wave_begin_ = wave_end_ = 0;
  for (const CellIndex c : targets) {
    if (distances_[Index(c)] == 0) continue;
    distances_[Index(c)] = 0;
    wave_[wave_end_++] = Index(c);
  }
}

/// Spreads the wave until it reaches cell n, or nothing more.
void DistanceGrid::SpreadTo(int n) {
  std::uint16_t* const d = distances_.data();
  int* const wave = wave_.data();
  const int stride = stride_;
  int begin = wave_begin_, end = wave_end_;
  while (begin < end && d[n] == kNotReached) {
    const int from = wave[begin++];
    const auto next = static_cast<std::uint16_t>(d[from] + 1);
    for (const int m : {from - 1, from + 1, from - stride, from + stride}) {
      if (d[m] != kNotReached) continue;
      d[m] = next;
      wave[end++] = m;
    }
  }
  wave_begin_ = begin;
  wave_end_ = end;
}

}  // namespace slalom::planners
