#include "planners/navigation/distance_grid.h"

#include <algorithm>

namespace slalom::planners {
namespace {

constexpr std::uint16_t kNotReached = 0xfffe;

}  // namespace

void DistanceGrid::Compute(const Costmap& costmap, std::span<const CellIndex> under_robot,
                           std::span<const CellIndex> targets) {
  stride_ = costmap.size_x() + 2;
  distances_.assign(static_cast<std::size_t>(stride_) * (costmap.size_y() + 2), kNoWay);
  wave_.resize(distances_.size());
  const auto index = [&](CellIndex c) { return (c.y + 1) * stride_ + c.x + 1; };
  for (int y = 0; y < costmap.size_y(); ++y) {
    const std::uint8_t* const costs = costmap.costs().data() + costmap.Index({0, y});
    std::uint16_t* const row = distances_.data() + index({0, y});
    for (int x = 0; x < costmap.size_x(); ++x) {
      row[x] = costs[x] >= kInscribedCost ? kNoWay : kNotReached;
    }
  }
  for (const CellIndex c : under_robot) distances_[index(c)] = kNotReached;

  int end = 0;
  for (const CellIndex c : targets) {
    if (distances_[index(c)] == 0) continue;
    distances_[index(c)] = 0;
    wave_[end++] = index(c);
  }
  std::uint16_t* const d = distances_.data();
  int* const wave = wave_.data();
  const int stride = stride_;
  for (int i = 0; i < end; ++i) {
    const int n = wave[i];
    const auto next = static_cast<std::uint16_t>(d[n] + 1);
    for (const int m : {n - 1, n + 1, n - stride, n + stride}) {
      if (d[m] != kNotReached) continue;
      d[m] = next;
      wave[end++] = m;
    }
  }
  std::replace(distances_.begin(), distances_.end(), kNotReached, kNoWay);
}

}  // namespace slalom::planners
