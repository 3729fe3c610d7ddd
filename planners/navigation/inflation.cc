#include "planners/navigation/inflation.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/check.h"

namespace slalom::planners {

Inflation::Inflation(double resolution, double inscribed_radius, double inflation_radius,
                     double scaling)
    : reach_(static_cast<int>(std::ceil(std::max(inflation_radius, 0.0) / resolution))) {
  const int side = 2 * reach_ + 1;
  stamp_.resize(static_cast<std::size_t>(side) * side);
  for (int dy = -reach_; dy <= reach_; ++dy) {
    for (int dx = -reach_; dx <= reach_; ++dx) {
      const double cells = std::sqrt(static_cast<double>(dx * dx + dy * dy));
      const double distance = cells * resolution;
      std::uint8_t cost = kFreeCost;
      if (dx == 0 && dy == 0) {
        cost = kLethalCost;
      } else if (cells > reach_) {
        cost = kFreeCost;
      } else if (distance <= inscribed_radius) {
        cost = kInscribedCost;
      } else {
        cost = static_cast<std::uint8_t>((kInscribedCost - 1) *
                                         std::exp(-scaling * (distance - inscribed_radius)));
      }
      stamp_[static_cast<std::size_t>(dy + reach_) * side + (dx + reach_)] = cost;
    }
  }
}

std::uint8_t Inflation::CostAt(int dx, int dy) const {
  if (std::abs(dx) > reach_ || std::abs(dy) > reach_) return kFreeCost;
  return stamp_[static_cast<std::size_t>(dy + reach_) * (2 * reach_ + 1) + (dx + reach_)];
}

void Inflation::Apply(const std::vector<std::uint8_t>& obstacles, const CellWindow& window,
                      Costmap& costmap) const {
  const int size_x = costmap.size_x(), size_y = costmap.size_y();
  SLALOM_CHECK_EQ(obstacles.size(), costmap.costs().size());
  std::uint8_t* const costs = costmap.mutable_costs().data();
  for (int y = window.y0; y < window.y1; ++y) {
    std::memset(costs + static_cast<std::size_t>(y) * size_x + window.x0, kFreeCost,
                static_cast<std::size_t>(window.x1 - window.x0));
  }
  const int side = 2 * reach_ + 1;
  const int from_x = std::max(0, window.x0 - reach_), to_x = std::min(size_x, window.x1 + reach_);
  const int from_y = std::max(0, window.y0 - reach_), to_y = std::min(size_y, window.y1 + reach_);
  for (int oy = from_y; oy < to_y; ++oy) {
    const std::uint8_t* const row = obstacles.data() + static_cast<std::size_t>(oy) * size_x;
    const std::uint8_t* next = row + from_x;
    const std::uint8_t* const end = row + to_x;
    while (next < end &&
           (next = static_cast<const std::uint8_t*>(
                std::memchr(next, kLethalCost, static_cast<std::size_t>(end - next)))) != nullptr) {
      const int ox = static_cast<int>(next - row);
      ++next;
      const int x0 = std::max(window.x0, ox - reach_), x1 = std::min(window.x1, ox + reach_ + 1);
      const int y0 = std::max(window.y0, oy - reach_), y1 = std::min(window.y1, oy + reach_ + 1);
      for (int y = y0; y < y1; ++y) {
        const std::uint8_t* const stamp =
            stamp_.data() + static_cast<std::size_t>(y - oy + reach_) * side - ox + reach_;
        std::uint8_t* const out = costs + static_cast<std::size_t>(y) * size_x;
        for (int x = x0; x < x1; ++x) out[x] = std::max(out[x], stamp[x]);
      }
    }
  }
}

}  // namespace slalom::planners
